"""Ready systems, each on one screen."""
