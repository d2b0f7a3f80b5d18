"""Recordings of poses whose directions are unknown: |a| = g, and labelled faces."""
