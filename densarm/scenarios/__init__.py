"""Scenarios: a task from a TOML file, and what plans, drives, runs and records it."""
