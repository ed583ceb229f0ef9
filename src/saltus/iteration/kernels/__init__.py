"""Compiled iterations of maps."""
