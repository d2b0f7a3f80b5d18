"""What a plan becomes: an output a file, its templates in a folder of its name."""
