"""Compiled steps and lives of lanes."""
