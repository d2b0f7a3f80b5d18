"""Chambers, tables and other instruments: what is ordered, and what they answer."""
