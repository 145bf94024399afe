"""Particles, weights, resampling, the particle filter, fixed-lag smoothing."""
