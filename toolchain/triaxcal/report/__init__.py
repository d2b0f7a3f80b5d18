"""Tables and pictures for people. Reads every room; no room imports it."""
