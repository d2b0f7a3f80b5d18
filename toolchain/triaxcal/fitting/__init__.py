"""From records to the twelve constants, their curves and their covariance."""
