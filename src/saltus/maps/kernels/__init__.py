"""Compiled iterations."""
