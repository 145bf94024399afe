"""Scans, surveys and radio maps."""
