"""What a bus or a log lacks for a session, and why nothing happens."""
