"""Which total gives way where a quantity of an orbit is fixed: docs/theory/conserved.md, "Fixed quantities"."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import InputError
from saltus.flow.formulas import read_formula
from saltus.orbits.stability.families import of_a_family
from saltus.scales import ILL_CONDITIONED
from saltus.system.evaluate import evaluate
from saltus.system.integrals.kept import KeptTotals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.observables.quantities import Quantity
    from saltus.orbits.problem import OrbitProblem
    from saltus.system import HybridSystem

__all__ = ["giving_way"]

_PLACES = 4  # states beyond their number at which a quantity is compared with totals
_ALL_ALONG = ("mean", "max", "min")  # what an expression that keeps its value has the value of


def giving_way(
    like: OrbitProblem, alone: OrbitProblem, u: NDArray[np.float64], quantity: Quantity, free: str
) -> KeptTotals | None:
    """Return what is kept while a quantity is fixed and no parameter freed; None for all totals.

    A quantity that is made of totals frees one of them. Any other one does so where orbits are isolated at all totals:
    it picks one of the family that they form, if the system has a single integral.

    Parameters
    ----------
    like, alone : OrbitProblem
        The equations as they were asked for; the same without active parameters and with all totals kept.
    u : ndarray
        An orbit or a guess.
    quantity : Quantity
        What is fixed.
    free : str
        The parameter that is freed; empty for none.

    Raises
    ------
    InputError
        There are several integrals, and which one the quantity frees cannot be told.
    """
    system = like.system
    if free or not system.laws:
        return None
    if like.conserving.freed >= 0:
        return like.conserving
    shares = _shares(system, like.parameters_at(u), quantity)
    if np.any(shares):
        return KeptTotals(system, freed=int(np.argmax(shares)))
    if of_a_family(alone, u[: like.size]):
        return None
    if len(system.laws) > 1:
        wanted = " or ".join(f"'mean({name})'" for name in system.conserved)
        hint = f"at fixed totals the orbit is isolated; one of them gives way: fix {wanted}"
        raise InputError("fix", quantity.name, "a conserved total, or with a parameter to free", hint)
    return KeptTotals(system, freed=0)


def _shares(system: HybridSystem, p: NDArray[np.float64], quantity: Quantity) -> NDArray[np.float64]:
    """Return how much of each integral is in a quantity that is a sum of them, shape (law,); zeros for any other."""
    none = np.zeros(len(system.laws))
    text = quantity.name
    if quantity.kind == "observable":
        (only,) = read_formula(system, text).parts.values()
        if only.kind not in _ALL_ALONG:
            return none
        text = only.of
    elif quantity.kind in ("min", "max"):
        text = text[4:]
    elif quantity.kind != "constant":
        return none
    count, rng = len(system.states), np.random.default_rng(len(text))
    places = rng.uniform(0.5, 1.5, (count + _PLACES, len(system.all_states)))
    parameters = dict(zip(system.parameter_names, p.tolist(), strict=True))
    found = none
    for mode in range(len(system.modes)):
        values = evaluate(system, text, places, np.full(len(places), mode), parameters)
        if not np.all(np.isfinite(values)):
            return none
        totals = places[:, :count] @ system.laws.matrix(p).T
        terms = np.column_stack([totals, np.ones(len(places))])
        parts, *_ = np.linalg.lstsq(terms, values, rcond=None)
        if np.abs(terms @ parts - values).max() > ILL_CONDITIONED * max(float(np.abs(values).max()), 1e-300):
            return none
        sizes = np.abs(parts[:-1]) * np.abs(totals).max(axis=0)
        found = np.where(sizes > ILL_CONDITIONED * sizes.max(initial=0.0), sizes, 0.0)
    return np.asarray(found)
