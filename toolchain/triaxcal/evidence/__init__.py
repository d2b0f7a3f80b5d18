"""What a recording says against or for the constants that were found from it."""
