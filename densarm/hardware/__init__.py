"""Hardware: what a loop needs of a real robot, the loop, and robots by their own protocols."""
