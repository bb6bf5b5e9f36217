"""From a URDF and SRDF to the models of an arm."""
