"""Extremes of outputs that are narrower than the places at which an orbit is surveyed.

The compiled survey looks at three places in a step. That shows a state and a polynomial of it. Another output may have
kinks, jumps and peaks between, which `saltus.flow.quadrature` finds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.flow.quadrature import Panels, exceeded
from saltus.orbits.observables.sampling import motion_of
from saltus.system.enclosure import enclose, is_polynomial
from saltus.system.once import once

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Survey
    from saltus.system import HybridSystem

__all__ = ["complete", "curved", "sought"]


def complete(
    problem: OrbitProblem, u: NDArray[np.float64], survey: Survey, outputs: Sequence[str] | None = None
) -> Survey:
    """Return a survey in which outputs have their extremes.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, which last surveyed `u`.
    u : ndarray, shape (size + active,) or longer
        The orbit.
    survey : Survey
        That survey. It is returned as it is where its places miss nothing.
    outputs : sequence of str, optional
        The outputs whose extremes are wanted; by default all. The search for those of one takes longer than a survey.
    """
    system = problem.system
    curved_ones = [name for name in curved(system) if outputs is None or name in outputs]
    if survey.coarse or not curved_ones or not np.all(np.isfinite(u)):
        return survey
    names = problem.named_at(u)
    modes, n = np.unique(problem.modes), problem.n
    box = tuple(np.tile(side[:n], (modes.size, 1)) for side in (survey.lows, survey.highs))
    narrow = [name for name in curved_ones if not np.all(enclose(system, name, (box[0], box[1]), modes, names).plain)]
    if not narrow:
        return survey
    motion = motion_of(problem, u)
    panels = Panels.of(motion, np.arange(len(motion.spans)), motion.spans)
    lows, highs = survey.lows.copy(), survey.highs.copy()
    for name in narrow:
        q, bounds = n + system.output_names.index(name), panels.bounds(name)
        if np.all(bounds.plain) or not np.isfinite(highs[q] - lows[q]):
            continue  # seen, or without a value on part of the orbit
        for side, sign in ((highs, 1.0), (lows, -1.0)):
            side[q] = sign * exceeded(panels, name, bounds, sign, sign * float(side[q]))
    return survey._replace(lows=lows, highs=highs)


def sought(orbit: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return least and greatest values of states and outputs of a `PeriodicOrbit`, what its survey missed included."""
    if not curved(orbit.system):
        return orbit.lows, orbit.highs
    problem = orbit.problem()
    seen = problem.survey(orbit.unknowns)._replace(lows=orbit.lows, highs=orbit.highs)
    found = complete(problem, orbit.unknowns, seen)
    return found.lows, found.highs


@once
def curved(system: HybridSystem) -> tuple[str, ...]:
    """Return the outputs that are no polynomials of low degree."""
    return tuple(name for name in system.output_names if not is_polynomial(system, name))
