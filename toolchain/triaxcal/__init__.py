"""Thermal calibration of triaxial accelerometers, down to verified fixed-point C."""

__version__ = "0.1.0"
