"""What a delivery can be exported to: a file each."""
