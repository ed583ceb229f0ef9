"""Compiled functions that generated code calls."""
