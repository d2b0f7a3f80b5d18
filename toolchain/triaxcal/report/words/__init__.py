"""Numbers, temperatures and tables in words."""
