"""Drivers of chambers and positioners, a file each; `rig.instrument` has what they share."""
