"""Values: arrays, compiled kernels, what numbers must be, and the files that they come from."""
