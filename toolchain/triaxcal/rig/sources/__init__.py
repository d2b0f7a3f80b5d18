"""Where frames come from: buses, serial ports, instruments, logs."""
