"""Scenes: obstacles around an arm and bodies that it holds, as values and from files."""
