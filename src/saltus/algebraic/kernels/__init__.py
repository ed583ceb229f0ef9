"""Compiled products."""
