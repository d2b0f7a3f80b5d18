"""Measurement uncertainty by the GUM (JCGM 100:2008): sources, their propagation, budgets."""
