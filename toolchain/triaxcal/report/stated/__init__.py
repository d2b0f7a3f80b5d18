"""What the laboratory states: key by key, and in words."""
