"""Playback of runs by meshcat: live in the browser, or as one HTML file."""
