"""plan.toml: the temperatures and positions of a session."""
