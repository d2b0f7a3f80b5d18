"""A session's decisions: still or not, at equilibrium or not, what comes next."""
