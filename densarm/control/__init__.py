"""Control: the density's laws, inverse dynamics within the limits, stopping, and a supervisor."""
