"""Arrays, angles, frames, errors, random numbers and the compiler: no algorithm of the field."""
