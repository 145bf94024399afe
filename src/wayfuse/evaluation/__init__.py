"""Truth, errors, intervals, calibration, reports and plots."""
