"""Noise of a signal at rest: spectrum, Allan deviation, the five coefficients of IEEE 952."""
