"""Compensation methods: a file each."""
