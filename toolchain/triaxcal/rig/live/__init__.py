"""A session as it runs, with or without hands."""
