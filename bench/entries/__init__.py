"""Benchmarks: each file here is one, with an `ENTRY` of its own; `bench/run.py` finds them."""
