"""A series of units: one unit's record, and the page that shows them all."""
