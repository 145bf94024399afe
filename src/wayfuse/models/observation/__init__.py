"""Observation models: how likely an observation is at each particle."""
