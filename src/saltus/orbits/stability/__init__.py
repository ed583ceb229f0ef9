"""Stability of periodic orbits: Floquet multipliers, their derivatives, critical orbits and families of orbits."""
