"""Recordings of other makers: files to samples, samples to poses."""
