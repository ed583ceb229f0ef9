"""Shrinking of volumes in state space along motions: a system without it has no attractor."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import InputError, SaltusError
from saltus.scales import BY_CHANCE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.ensemble.ensemble import Ensemble
    from saltus.ensemble.map_ensemble import MapEnsemble
    from saltus.flow.variational import Growth

__all__ = ["check_contraction", "grows", "keeps", "nothing_attracts", "preserves", "shrinking"]

_MOTIONS = 8  # motions along which volumes are watched
_PERIODS = 16  # strobes for which they are watched

_NEGLIGIBLE = 0.01  # change of a volume's logarithm over a whole search below which nothing attracts


def preserves(growth: Growth, periods: int, longest: int) -> bool:
    """Return whether the change of volumes along a motion is negligible over the longest time.

    Parameters
    ----------
    growth : Growth
        Growth of as many perturbations as there are states.
    periods : int
        Periods over which the growth was measured.
    longest : int
        Periods that motions are followed.
    """
    change = float(growth.logs.sum()) / periods
    return math.isfinite(change) and abs(change) * longest < _NEGLIGIBLE


def keeps(growth: Growth) -> bool:
    """Return whether the mean change of volumes along a motion is 0 within its error."""
    whole = replace(growth, logs=growth.logs.sum(axis=1, keepdims=True))
    return bool(abs(float(whole.exponents[0])) <= BY_CHANCE * float(whole.errors[0]))


def grows(growth: Growth) -> bool:
    """Return whether a perturbation grows along a motion, clearly."""
    return bool((growth.exponents > BY_CHANCE * growth.errors).any())


def shrinking(growth: Growth) -> float:
    """Return the slowest rate per unit of time, below 0, at which motions come to the set to which one leads.

    It is the largest exponent that is clearly below 0; ``-inf`` without one, or where perturbations grow. Perturbations
    that have not changed by a factor e have not turned to their directions either: of their exponents only the sum is
    known, and one of them is that of the set.
    """
    if grows(growth):
        return -math.inf
    rates = growth.exponents
    mixed = np.abs(rates) * growth.times[-1] < 1.0
    if mixed.sum() > 1:
        rates = np.append(rates[~mixed], rates[mixed].sum() / (mixed.sum() - 1))
        return float(rates[rates < 0.0].max(initial=-math.inf))
    return float(rates[rates < -BY_CHANCE * growth.errors].max(initial=-math.inf))


def check_contraction(ensemble: Ensemble | MapEnsemble, starts: NDArray[np.float64], longest: int) -> None:
    """Raise `InputError` where volumes keep their size along all of several motions: nothing attracts then.

    By Liouville's theorem the logarithm of a volume grows by the integral of the field's divergence. At an event it
    grows by the logarithm of the saltation matrix' determinant. The mean rate of both is the sum of all Lyapunov
    exponents: docs/theory/lyapunov.md.

    Parameters
    ----------
    ensemble : Ensemble
        Engine of the system at its parameters.
    starts : ndarray, shape (m, n)
        States from which motions can start.
    longest : int
        Periods that motions are followed.
    """
    seen = 0
    for x in starts[:: -(-len(starts) // _MOTIONS)]:
        try:
            growth = ensemble.growth(x, ensemble.starting_mode(x), _PERIODS, 0)
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
    return InputError("system", f"{name or 'a system'}{' at ' * bool(given)}{given}"[:120], allowed,
                      "it conserves them, or the interval is far shorter than its decay")  # fmt: skip
