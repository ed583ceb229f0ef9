"""Pools of lanes that take the same kind of step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

from saltus.errors import SaltusError
from saltus.system.expansion import expanded
from saltus.system.writing.linear_split import split_of_mode
from saltus.system.writing.regularise import regularised

if TYPE_CHECKING:
    from saltus.system.derivatives import Symbolic
    from saltus.system.writing.linear_split import Split
    from saltus.system.writing.regularise import Regularised

__all__ = ["Pool", "domain_to_check", "pools_of"]


@dataclass(frozen=True)
class Pool:
    """Lanes that take the same kind of step."""

    mode: int  # index of their mode
    form: Regularised | None = None  # the mode's field in sigma
    split: Split | None = None  # the mode's linear part, where steps are by its exact flow
    pairs: int = 0  # pairs of complex eigenvalues of that linear part


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
