"""What to turn an IMU to next, from what its recording shows so far."""
