"""The unit's passport: one page for readers, one JSON file for programs, the same content."""
