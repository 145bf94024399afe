"""From accelerometer and gyroscope to attitude, steps, step length, heading, standing."""
