"""State blocks: each file is one effect, switched on by its name."""
