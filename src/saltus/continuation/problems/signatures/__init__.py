"""Rows of segments as signatures: cut, joined, rerouted, where an orbit's signature changes."""
