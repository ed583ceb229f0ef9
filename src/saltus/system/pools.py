"""Pools of lanes that take the same kind of step, and what a lane reports after one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

from saltus.errors import SaltusError
from saltus.system.expansion import expanded
from saltus.system.regularise import regularised
from saltus.system.split import split_of_mode

if TYPE_CHECKING:
    from saltus.system.derivatives import Symbolic
    from saltus.system.regularise import Regularised
    from saltus.system.split import Split

__all__ = [
    "AT_STROBE",
    "CHANGES",
    "DIVERGED",
    "DONE",
    "EVENT",
    "FALLING",
    "GOES_ON",
    "GONE",
    "HARD",
    "HUGE",
    "LEFT_OVER",
    "MOST_STEPS",
    "NOT_DONE",
    "STUCK",
    "UNDECIDED",
    "Pool",
    "domain_to_check",
    "pools_of",
]  # fmt: skip

GOES_ON, AT_STROBE, STUCK, CHANGES, EVENT = 0.0, 1.0, 2.0, 3.0, 4.0
"""Flags of a lane after a step: nothing to do; at phase 0; no step; another kind of step; event j of its mode is
``EVENT + j``."""

HARD, GONE, DONE = -1, -2, -3
"""Instead of a pool: a motion that steps without branches cannot follow, one beyond all bounds, one with a label."""

LEFT_OVER, DIVERGED, UNDECIDED, NOT_DONE = 252, 253, 254, 255
"""Labels besides those of attractors: of a hard motion until another engine has followed it, of one that has grown
beyond all bounds, of one not settled in time, and of one not followed yet."""

MOST_STEPS = 3000.0
"""Steps between two looks after which a motion is hard."""

FALLING = 48
"""Looks up to which a motion's tolerance may grow: one that has not met its fate by then is on a slow way, or on one of
its own, and no longer falls into a trap."""

HUGE = "1e300"
"""Text of a step's largest length where nothing limits it."""


@dataclass(frozen=True)
class Pool:
    """Lanes that take the same kind of step.

    Attributes
    ----------
    mode : int
        Index of their mode.
    form : Regularised or None
        The mode's field in sigma.
    split : Split or None
        The mode's linear part, where steps are by its exact flow.
    pairs : int
        Pairs of complex eigenvalues of that linear part.
    """

    mode: int
    form: Regularised | None = None
    split: Split | None = None
    pairs: int = 0


def pools_of(system: Symbolic, exact: dict[int, int]) -> list[Pool]:
    """Return the pools of a system: one a mode, then one for each mode in `exact`, with its pairs of eigenvalues."""
    pools = [Pool(mode, regularised(system, mode)) for mode in range(len(system.field))]
    for mode, pairs in exact.items():
        split = split_of_mode(system, mode)
        if split is None:
            raise SaltusError(f"mode {mode} has no linear part")
        if domain_to_check(system, mode) is None:
            pools.append(Pool(mode, None, split, pairs))
    return pools


def domain_to_check(system: Symbolic, mode: int) -> sympy.Expr | None:
    """Return the domain of a mode; None where there is none, or an event of the mode comes before its border."""
    domain = system.domain[mode]
    if not domain.free_symbols & set(system.x):
        return None
    positive = {symbol: sympy.Dummy(positive=True) for symbol in system.p if symbol.name in system.system.positive}
    for k, source in enumerate(system.source):
        direction = system.system.transitions[k].direction
        if source == mode and direction and system.when[k] == 1:
            margin = expanded((domain + direction * system.event[k]).xreplace(positive))
            if margin.is_nonnegative:
                return None
    return domain
