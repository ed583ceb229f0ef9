"""Compiled control of steps."""
