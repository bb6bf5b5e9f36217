"""The world: distances of every pair of bodies, their changes, and proofs about motions."""
