"""Ways of end-to-end protection, a file each; `..protection` has what they share."""
