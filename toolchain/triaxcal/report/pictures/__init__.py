"""Every drawing: in the passport, on the pages, and as matplotlib figures."""
