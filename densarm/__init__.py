"""Collision-free motion of robot arms by navigation density functions."""
