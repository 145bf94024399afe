"""One file per building format."""
