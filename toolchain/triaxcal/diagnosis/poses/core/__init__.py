"""Poses as arrays, what a cause did to them, and its evidence."""
