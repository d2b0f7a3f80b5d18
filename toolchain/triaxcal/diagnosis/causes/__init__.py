"""Causes of contradictory readings, one file each."""
