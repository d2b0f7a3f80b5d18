"""Whole-IMU calibration on a rough single-axis turntable: state blocks and a square-root filter."""
