"""The public Python API: what `import triaxcal` offers. It prints nothing and asks nothing."""
