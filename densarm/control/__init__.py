"""Controllers: joint torque from time and state."""
