"""The generated C on other cores, under emulation: the same bits, and what they cost."""
