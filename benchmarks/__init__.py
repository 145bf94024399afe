"""Benchmarks: ratios of variants that take turns in one run, minima and medians; never asserted in tests."""
