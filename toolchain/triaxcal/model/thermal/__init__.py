"""Thermal functions: a file each."""
