"""The only place that prints, reads the command line and exits."""
