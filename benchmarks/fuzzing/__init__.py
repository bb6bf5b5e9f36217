"""Broken input files for densarm's parsers, and a watch over what the parsers do with them."""
