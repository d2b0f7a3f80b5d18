"""What a rig sends: messages, signals, protections, and rig.toml that names them."""
