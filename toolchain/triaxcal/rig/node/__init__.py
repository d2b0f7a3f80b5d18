"""Firmware in the loop: the node that sends, and the one that listens."""
