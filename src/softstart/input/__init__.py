"""What people give and get: parameters in SI, TOML documents both ways, files found, read and written."""
