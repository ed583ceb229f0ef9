"""Compiled steps of motions, their events and derivatives."""
