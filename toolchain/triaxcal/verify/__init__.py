"""Verifying a delivered unit with other people's tools: bounds, analysers, sanitizers, mutants."""
