"""The TOML files as wholes: their catalogue, reference, JSON Schemas and first versions."""
