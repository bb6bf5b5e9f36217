"""Studies: baselines, problems by the dozen, and what a control step costs."""
