"""certificate.dcc.xml: the Digital Calibration Certificate, a file for each of its parts."""
