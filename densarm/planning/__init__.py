"""Planning: from a guide's sub-goals to a motion that is smooth, timed and proved."""
