"""Navigation densities: inverse bumps, unsafe sets, goal distances, and the field they make."""
