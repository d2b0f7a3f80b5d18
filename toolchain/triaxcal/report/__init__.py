"""Tables and pictures for readers. Reads every room; no room imports it."""
