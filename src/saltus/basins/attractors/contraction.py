"""How fast volumes in state space shrink along motions: where they do not, nothing attracts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import InputError, SaltusError
from saltus.flow.motion import starting_mode
from saltus.flow.variational import Growth, growth_along

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.ensemble.ensemble import Ensemble

__all__ = ["check_contraction", "growth_of", "nothing_attracts", "preserves"]

_MOTIONS, _PERIODS = 8, 16
"""Motions along which volumes are watched, and for how many periods."""

_NEGLIGIBLE = 0.01
"""Change of the logarithm of a volume, in all periods that motions are followed, below which nothing can attract."""


def growth_of(ensemble: Ensemble, x: NDArray[np.float64], mode: int, periods: int, discard: int | None) -> Growth:
    """Return how perturbations grow along a motion, over periods of the phase or intervals of a system without one."""
    system = ensemble.system
    if system.phase is not None:
        return growth_along(system, ensemble.p, x, mode, periods=periods, discard=discard)
    wait = None if discard is None else discard * ensemble.period
    return growth_along(system, ensemble.p, x, mode, t_end=periods * ensemble.period, discard=wait)


def preserves(growth: Growth, periods: int, longest: int) -> bool:
    """Return whether volumes along a motion change so little that nothing attracts it within the longest time.

    Parameters
    ----------
    growth : Growth
        Of as many perturbations as there are states.
    periods : int
        Over how many.
    longest : int
        Periods that motions are followed.
    """
    change = float(growth.logs.sum()) / periods
    return math.isfinite(change) and abs(change) * longest < _NEGLIGIBLE


def check_contraction(ensemble: Ensemble, starts: NDArray[np.float64], longest: int) -> None:
    """Raise `InputError` where volumes stay as they are along all of some motions: no set attracts others then.

    By Liouville's theorem a volume grows as the integral of the field's divergence, and by the determinant of the
    saltation matrix at events: together the sum of all Lyapunov exponents.

    Parameters
    ----------
    ensemble : Ensemble
        Whose system, at which parameters.
    starts : ndarray, shape (m, n)
        States from which motions can start.
    longest : int
        Periods that motions are followed.
    """
    seen = 0
    for x in starts[:: -(-len(starts) // _MOTIONS)]:
        full = ensemble.system.full_state(x)
        try:
            growth = growth_of(ensemble, full, starting_mode(ensemble.system, full, ensemble.p), _PERIODS, 0)
        except SaltusError:  # it chatters or diverges: to be seen when it is followed
            return
        if not preserves(growth, _PERIODS, longest):
            return
        seen += 1
    raise nothing_attracts(ensemble.system.name, ensemble.parameters, f"along {seen} motions", longest)


def nothing_attracts(name: str, parameters: Mapping[str, float], where: str, longest: int) -> InputError:
    """Return the error of a system without attractors."""
    given = ", ".join(f"{key} = {value:.6g}" for key, value in parameters.items())
    allowed = f"one with attractors: {where} volumes change by less than 1 % in the {longest} periods followed"
    return InputError("system", f"{name or 'a hybrid system'}{' at ' * bool(given)}{given}"[:120], allowed,
                      "it conserves them, or the interval is far shorter than its decay")  # fmt: skip
