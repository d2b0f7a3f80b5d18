"""The unit's passport: one page for people, one JSON file for machines, the same content."""
