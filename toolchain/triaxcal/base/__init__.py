"""What every room stands on: errors, strict TOML, JSON text, shipped files, files in place."""
