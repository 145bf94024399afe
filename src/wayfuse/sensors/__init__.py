"""Typed records, recordings in time order, and the verdicts on bad data."""
