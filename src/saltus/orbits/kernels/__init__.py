"""Compiled equations of orbits and what is surveyed along them."""
