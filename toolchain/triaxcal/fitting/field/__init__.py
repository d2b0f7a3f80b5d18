"""What recordings from the field say of a delivered calibration."""
