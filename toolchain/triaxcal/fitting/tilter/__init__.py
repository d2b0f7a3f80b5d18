"""Six known positions at several temperatures: the tilter."""
