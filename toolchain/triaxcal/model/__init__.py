"""The metrological model and its thermal functions: pure floats, no fitting."""
