"""The command line: one file per command, lazy imports."""
