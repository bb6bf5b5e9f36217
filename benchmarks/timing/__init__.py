"""Times taken in turns, their spread, and where they were taken."""
