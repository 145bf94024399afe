"""Motion models: how a cloud moves."""
