"""Arms: from a URDF and SRDF to the models, limits and postures of a robot arm."""
