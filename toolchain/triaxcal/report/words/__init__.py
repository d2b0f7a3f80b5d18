"""Numbers, temperatures and tables as people read them."""
