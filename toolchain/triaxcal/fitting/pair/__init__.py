"""An orthogonal pair of accelerometers on a dividing head."""
