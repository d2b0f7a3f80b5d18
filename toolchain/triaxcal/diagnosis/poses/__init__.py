"""Which physical cause explains the poses of a recording best, of which only |a| = g is known."""
