"""Everything that can be read: one reader interface, one file a format; columns, units, clocks."""
