"""Buildings, walkers, sensors and radio made up from scratch; shares no estimator code."""
