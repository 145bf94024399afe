"""Constraints: which moves a building allows."""
