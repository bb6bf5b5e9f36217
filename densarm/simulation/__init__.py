"""Simulation: plants, the fixed-step loop around them, and the record of a run."""
