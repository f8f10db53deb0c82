"""Arms and cameras, real and simulated; strangers to each other."""
