"""Coefficients of normal forms along loci of orbits, as monitor functions take them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.orbits.normal_forms import null_vectors, torus_coefficient
from saltus.orbits.problem import OrbitProblem

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["known_coefficient", "or_infinity", "torus_at"]


def torus_at(problem: OrbitProblem, J: NDArray[np.float64], u: NDArray[np.float64], kappa: float) -> float:
    """Return the coefficient of a torus bifurcation whose multipliers have the real part `kappa`."""
    mu = complex(kappa, math.sqrt(1.0 - kappa * kappa))
    q, p, _ = null_vectors(problem, u, J, mu)
    return torus_coefficient(problem, u, J, mu, q, p).real


def known_coefficient(coefficient: float, only: Monitor | None) -> float:
    """Return a coefficient; NaN where it is exactly 0, perhaps all along, unless its zero is being located."""
    return math.nan if coefficient == 0.0 and only is None else coefficient


def or_infinity(function: Callable[..., float], *arguments: Any) -> float:
    """Return the value of a function, or infinity at its pole, where a matrix is singular."""
    try:
        return function(*arguments)
    except np.linalg.LinAlgError:
        return math.inf
