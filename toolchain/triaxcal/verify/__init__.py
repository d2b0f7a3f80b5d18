"""Verifying a delivered unit with external tools: bounds, analysers, sanitizers, mutants."""
