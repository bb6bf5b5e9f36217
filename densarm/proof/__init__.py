"""What is proved about motions between configurations."""
