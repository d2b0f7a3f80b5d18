"""The whole road for one unit, or one IMU: readings to files."""
