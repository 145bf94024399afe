"""One file per log or data-set format: bytes to records, nothing guessed."""
