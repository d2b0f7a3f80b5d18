"""From frames to numbered samples of a triad."""
