"""Calibrations from other static recordings than the tilter's: known and unknown orientations."""
