"""What to measure: the plan that reaches an uncertainty in the least chamber time."""
