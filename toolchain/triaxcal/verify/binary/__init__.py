"""The compiled routine against the specification, instruction by instruction, for every input."""
