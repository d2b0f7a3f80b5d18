"""Integer arithmetic: the plan, its bit-exact model and the proof of its bounds."""
