"""The pipeline that most would write: RRT-Connect, TOPP-RA, computed torque."""
