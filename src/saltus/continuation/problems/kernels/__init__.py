"""Compiled stretches of branches."""
