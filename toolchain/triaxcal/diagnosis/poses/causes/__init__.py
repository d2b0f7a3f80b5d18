"""Causes of what poses contradict: a file each."""
