"""Certificates: what is proved about a recorded run, and what is recorded beside."""
