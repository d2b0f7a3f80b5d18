"""Cores: a file each."""
