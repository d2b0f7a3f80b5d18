"""Units that do not exist, made by exact physics from a stated truth."""
