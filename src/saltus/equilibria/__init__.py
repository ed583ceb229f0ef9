"""Equilibria of autonomous systems, mode by mode."""

from saltus.equilibria.equilibrium import Equilibrium
from saltus.equilibria.find import find_equilibrium

__all__ = ["Equilibrium", "find_equilibrium"]
