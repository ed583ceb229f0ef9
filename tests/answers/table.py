"""All known answers, by kind."""

from __future__ import annotations

from answers.answer import Answer
from answers.attractors import BASINS, EXPONENTS, WORDS
from answers.bifurcations import OF_EQUILIBRIA, OF_MAPS, OF_ORBITS
from answers.microscopy import FORCES, LEVERS
from answers.orbits import ORBITS, SENSITIVITIES, SLIDING

ANSWERS: dict[str, list[Answer]] = {
    "Periodic orbits": ORBITS,
    "Sliding and coming to rest": SLIDING,
    "Derivatives in parameters": SENSITIVITIES,
    "Bifurcations of orbits": OF_ORBITS,
    "Equilibria, cycles born and lost": OF_EQUILIBRIA,
    "Bifurcations of maps": OF_MAPS,
    "Lyapunov exponents": EXPONENTS,
    "Kinds of motion": WORDS,
    "Basins": BASINS,
    "Cantilevers": LEVERS,
    "Forces and losses": FORCES,
}
"""Headings of the page, in its order."""
