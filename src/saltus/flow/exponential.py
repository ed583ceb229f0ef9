"""Tables of exponential collocation: what polynomial forces make of a linear part's states in steps of a few lengths.

A force is known by its values at Gauss's nodes of a step. The linear part's answer is the integral of its exponential
times the polynomial through them: docs/theory/flow.md, "Fast oscillations".

References
----------
Hochbruck, Ostermann, Acta Numerica 19 (2010) 209-286, doi:10.1017/S0962492910000048: exponential integrators.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import legendre

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LEVELS", "NODES", "SHORTEST", "STAGES", "TAILS", "speed", "tables"]

STAGES = 16  # nodes of a step, on which forces are polynomials of degree 15
LEVELS = 17  # lengths of steps, each the root of 2 times the one before
SHORTEST = 0.125  # the first one, times the rate at which the linear part turns or decays
_POINTS = 48  # of the rule by which answers are integrated, exact to rounding for the longest step

_X, _W = legendre.leggauss(STAGES)
# of a polynomial in Legendre's, from its values
_COEFFICIENTS = (np.arange(STAGES) + 0.5)[:, None] * _W * legendre.legvander(_X, STAGES - 1).T
NODES = 0.5 + 0.5 * _X  # on [0, 1]
TAILS = _COEFFICIENTS[-4:]  # the coefficients of degrees 12 to 15, shape (4, nodes)

_ENDS = np.append(NODES, 1.0)  # of the integrals
_Y, _V = legendre.leggauss(_POINTS)
_AT = 0.5 * (1.0 + _Y)  # where in an integral
_BASES = legendre.legvander(2.0 * np.outer(_ENDS, _AT) - 1.0, STAGES + 1)
# of each integral and point, what each value at the nodes weighs, and Legendre's polynomials of the next two degrees
_WEIGHTS = np.concatenate([_BASES[..., :STAGES] @ _COEFFICIENTS, _BASES[..., STAGES:]], axis=2)
_WEIGHTS *= (0.5 * _V)[:, None] * _ENDS[:, None, None]


def speed(part: NDArray[np.float64]) -> float:
    """Return the rate at which the fastest states of a linear part turn or decay; rows as in `tables`."""
    pairs = _pairs(part)
    return float((np.abs(pairs.mean) + np.sqrt(np.abs(pairs.curl))).max())


class _Pairs(NamedTuple):
    """Pairs of components, each shape (n,)."""

    partners: NDArray[np.intp]
    to: NDArray[np.float64]  # entries of the linear part for the partners
    # mean, half: of the diagonal's two entries the mean, and half of what the own one is larger by
    mean: NDArray[np.float64]
    half: NDArray[np.float64]
    curl: NDArray[np.float64]  # square of half the distance of the two eigenvalues, negative where they turn


def _pairs(part: NDArray[np.float64]) -> _Pairs:
    partners, diagonal = part[:, 0].astype(np.intp), part[:, 1]
    to = np.where(partners == np.arange(len(part)), 0.0, part[:, 2])
    half = 0.5 * (diagonal - diagonal[partners])
    return _Pairs(partners, to, 0.5 * (diagonal + diagonal[partners]), half, half * half + to * to[partners])


def tables(part: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what steps of each length make of states and forces, in the order of `kernels.exponential_step.Level`.

    Parameters
    ----------
    part : ndarray, shape (n, 5)
        Of each component its partner, and the entries of the linear part for itself and for the partner. Then those of
        the column and the row of the rest's slopes, as in `saltus.flow.linear_parts.LinearPart`.

    Returns
    -------
    ndarray, shape (LEVELS, numbers)
        One row for each length.
    """
    other, to, mean, half, curl = _pairs(part)
    push, look = part[:, 3], part[:, 4]
    lengths = SHORTEST / speed(part) * np.sqrt(2.0) ** np.arange(LEVELS)
    straight, turned = _exponentials(lengths[:, None] * _ENDS, mean, curl)
    own, across = straight + half[:, None, None] * turned, to[:, None, None] * turned
    remaining = lengths[:, None, None] * _ENDS[:, None] * (1.0 - _AT)
    kept, led = (lengths[:, None, None] * np.einsum("elip,ipj->elij", values, _WEIGHTS, optimize=True)
                 for values in _exponentials(remaining, mean, curl))  # fmt: skip
    within = kept + half[:, None, None, None] * led  # a component's answer to forces on itself
    beside = to[:, None, None, None] * led  # and to those on its partner
    moved = within * push[:, None, None, None] + beside * push[other][:, None, None, None]  # by the rest's function
    seen = within * look[:, None, None, None] + (beside * look[:, None, None, None])[other]
    looks = own * look[:, None, None] + (across * look[:, None, None])[other]
    coupled = np.einsum("elij,e->lij", moved, look)
    next_two = np.abs(moved[:, :, -1, STAGES:]).sum(axis=2)  # (n, levels)
    worst = np.abs(coupled[:, :-1, STAGES:]).sum(axis=2).max(axis=1)
    rows = []
    for i in range(LEVELS):
        nodes = slice(0, STAGES)
        parts = (
            [lengths[i], worst[i], STAGES], next_two[:, i], own[:, i, nodes], across[:, i, nodes], own[:, i, -1],
            across[:, i, -1], looks[:, i, nodes], moved[:, i, -1, nodes], within[:, i, -1, nodes],
            beside[:, i, -1, nodes], coupled[i, nodes, nodes].T,
            *(table[:, i, nodes, nodes].transpose(0, 2, 1) for table in (within, beside, seen)),
        )  # fmt: skip
        rows.append(np.concatenate([np.ravel(values) for values in parts]))
    return np.array(rows)


def _exponentials(
    times: NDArray[np.float64], mean: NDArray[np.float64], curl: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return exp(mean t) times cosh and sinh of sqrt(curl) t, the latter over sqrt(curl), shapes (n, *times)."""
    straight, turned = np.empty((2, mean.size, *times.shape))
    for e, (m, c) in enumerate(zip(mean.tolist(), curl.tolist(), strict=True)):
        root, grown = np.sqrt(abs(c)), np.exp(m * times)
        cosine, sine = (np.cos, np.sin) if c < 0.0 else (np.cosh, np.sinh)
        straight[e] = grown * cosine(root * times)
        turned[e] = grown * (sine(root * times) / root if root > 0.0 else times)
    return straight, turned
