"""Whole-IMU calibration, by hand or on a rough turntable: state blocks, square-root filter."""
