"""Many units in one chamber run."""
