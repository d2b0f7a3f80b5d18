"""The description of a unit, unit.toml: each of its tables a file."""
