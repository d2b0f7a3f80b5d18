"""Logs of a bus: read, and written in the forms of other programs."""
