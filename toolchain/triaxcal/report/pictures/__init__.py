"""Every drawing of a report."""
