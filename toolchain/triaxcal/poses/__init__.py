"""Still stretches in a stream of samples."""
