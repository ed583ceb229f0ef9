"""Steps of an orbit divided where expressions along it ask for it, so that its variations are integrated as they are.

The kernel of derivatives looks at some places in each step. That is enough for states and polynomials. A step that
holds a peak, a kink or a wave of another expression is divided, as for the value. So is its dense output.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.flow.quadrature import Panels, partition
from saltus.flow.stretch import POWERS_OF_TERMS, Motion, clustered_clocks, dense_states
from saltus.scales import FINEST
from saltus.system.enclosure import enclose, is_polynomial

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["Varied", "divided", "narrow"]

_MARGIN = 0.125  # share of a state's range by which its extremes may lie beyond those at nodes


class Varied(NamedTuple):
    """Dense output of an orbit with its variations.

    Attributes
    ----------
    mesh : (ndarray, ndarray)
        As in `saltus.orbits.records.Mesh`.
    nodes : ndarray, shape (node, components)
        States with their variations.
    coefficients : ndarray, shape (node, 7, components)
        Those of the step from each node on.
    """

    mesh: tuple[NDArray[np.float64], NDArray[np.int64]]
    nodes: NDArray[np.float64]
    coefficients: NDArray[np.float64]


def narrow(problem: OrbitProblem, u: NDArray[np.float64], path: Varied, expressions: Sequence[str]) -> list[str]:
    """Return the expressions of which a few places in a step may miss something, by bounds over the whole orbit."""
    system, n = problem.system, problem.n
    texts = [text for text in expressions if not is_polynomial(system, text)]
    if not texts or not np.all(np.isfinite(path.nodes)):
        return []
    modes = np.unique(problem.modes)
    low, high = path.nodes[:, :n].min(axis=0), path.nodes[:, :n].max(axis=0)
    room = _MARGIN * (high - low)
    box = np.tile(low - room, (modes.size, 1)), np.tile(high + room, (modes.size, 1))
    names = problem.named_at(u)
    return [text for text in texts if not np.all(enclose(system, text, box, modes, names).plain)]


def divided(problem: OrbitProblem, u: NDArray[np.float64], path: Varied, expressions: Sequence[str]) -> Varied:
    """Return the dense output with steps divided where some expressions ask for it.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    u : ndarray, shape (size + active,) or longer
        The orbit.
    path : Varied
        Its dense output.
    expressions : sequence of str
        What is integrated, or has its extreme sought.
    """
    motion, first = _motion(problem, u, path)
    panels = Panels.of(motion, np.arange(len(motion.spans)), motion.spans)
    found = [partition(panels, text) for text in expressions]
    cuts = np.unique(np.concatenate([np.column_stack([steps, spans[:, 0]]) for steps, spans in found]), axis=0)
    if len(cuts) == first.size:
        return path
    steps, begins = cuts[:, 0].astype(np.intp), cuts[:, 1]
    ends = np.append(begins[1:], 1.0)
    ends[np.append(steps[1:] != steps[:-1], True)] = 1.0
    return _cut(path, first, steps, begins, ends - begins)


def _motion(problem: OrbitProblem, u: NDArray[np.float64], path: Varied) -> tuple[Motion, NDArray[np.intp]]:
    """Return the orbit on that dense output as a motion, and the node with which each of its steps begins."""
    (places, starts), n = path.mesh, problem.n
    first = np.delete(np.arange(places.size), starts[1:] - 1)
    segments = np.repeat(np.arange(problem.segments), np.diff(starts) - 1)
    durations = u[n : problem.size : n + 1]
    s, h = places[first], places[first + 1] - places[first]
    duration, begun = durations[segments], (np.cumsum(durations) - durations)[segments]
    nodes, coefficients = path.nodes[:, :n], path.coefficients[:, :, :n]
    return (
        Motion(
            system=problem.system,
            parameters=problem.named_at(u),
            modes=problem.modes[segments],
            clocks=clustered_clocks(begun, duration, s, h),
            spans=np.tile([0.0, 1.0], (first.size, 1)),
            states=lambda at, fractions: dense_states(nodes[first[at]], coefficients[first[at]], fractions),
            crossings=[],
            angle=(0.0, 0.0),
            tolerance=FINEST,
        ),
        first,
    )


def _cut(
    path: Varied,
    first: NDArray[np.intp],
    steps: NDArray[np.intp],
    begins: NDArray[np.float64],
    widths: NDArray[np.float64],
) -> Varied:
    """Return the dense output in parts of steps, in their order; first: the node with which each step begins."""
    (places, starts), rows = path.mesh, first[steps]
    nodes = dense_states(path.nodes[rows], path.coefficients[rows], begins)
    bends = np.einsum("pij,pjc->pic", _shifts(begins, widths), path.coefficients[rows])
    at = places[rows] + begins * (places[rows + 1] - places[rows])
    last = starts[1:] - 1
    counts = np.searchsorted(rows, last)  # parts before the end of each segment
    table = (np.insert(values, counts, ends, axis=0) for values, ends in (
        (at, places[last]), (nodes, path.nodes[last]), (bends, path.coefficients[last])))  # fmt: skip
    new_starts = np.concatenate([[0], counts + np.arange(1, counts.size + 1)]).astype(np.int64)
    new_places, new_nodes, new_bends = (np.ascontiguousarray(one) for one in table)
    return Varied((new_places, new_starts), new_nodes, new_bends)


_TERMS = np.linalg.inv(POWERS_OF_TERMS)  # terms of a polynomial without a constant, by its powers
_CHOOSE = np.array([[float(np.prod([(k - i) / (i + 1) for i in range(j)])) for k in range(8)] for j in range(8)])


def _shifts(begins: NDArray[np.float64], widths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrices that turn the terms of steps into those of their parts, shape (part, 7, 7)."""
    j, k = np.arange(8)[:, None], np.arange(8)[None, :]
    powers = np.where(k >= j, k - j, 0)
    moved = np.where(k >= j, _CHOOSE, 0.0) * begins[:, None, None] ** powers * widths[:, None, None] ** j
    return np.asarray(_TERMS @ moved[:, 1:, 1:] @ POWERS_OF_TERMS)
