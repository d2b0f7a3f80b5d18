"""What a session writes: journal, raw frames, measurements; and what is read back."""
