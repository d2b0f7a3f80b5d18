"""Poses with the angles of a table."""
