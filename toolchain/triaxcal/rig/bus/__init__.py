"""Frames of a CAN bus, and buses by their names."""
