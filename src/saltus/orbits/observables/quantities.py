"""Quantities of a periodic orbit by name, and their values.

docs/theory/conservative.md, "Quantities", lists them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.errors import InputError, nearest
from saltus.flow.formulas import read_formula
from saltus.flow.observables import observe, unheard
from saltus.orbits.observables.outputs import complete
from saltus.orbits.observables.sampling import motion_of
from saltus.scales import CONSTANT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.system import HybridSystem

__all__ = ["Quantity", "read_quantity", "sizes_of_unknowns"]

_EXAMPLES = "'period', 'max_x' or 'mean(x)'"


@dataclass(frozen=True)
class Quantity:
    """A quantity of a periodic orbit."""

    name: str  # as the user wrote it
    # ``period``, ``min``, ``max``, ``constant`` (a state or output that keeps its value), ``observable`` or ``formula``
    # (one in observables)
    kind: str
    column: int = -1  # index among states and outputs; -1 of a period and of an observable
    turn: float = 0.0  # angle up to which a phase is defined, in radians; 0 of all other quantities

    def value(self, problem: OrbitProblem, u: NDArray[np.float64]) -> float:
        """Return the quantity of the orbit `u`, which is surveyed for it.

        Parameters
        ----------
        problem : OrbitProblem
            Its equations, meshes made.
        u : ndarray, shape (size + active,) or longer
            Unknowns.
        """
        if self.kind == "period":
            return float(u[problem.n : problem.size : problem.n + 1].sum())
        survey = problem.survey(u)
        if self.kind in ("observable", "formula"):
            return observe(motion_of(problem, u), (self.name,), unheard)[self.name]
        if self.column >= problem.n:
            survey = complete(problem, u, survey, [problem.system.output_names[self.column - problem.n]])
        if self.kind == "constant":
            return 0.5 * float(survey.lows[self.column] + survey.highs[self.column])
        return float((survey.lows if self.kind == "min" else survey.highs)[self.column])

    def beyond(self, value: float, wanted: float) -> float:
        """Return a value less a wanted one; of a phase the least angle between both."""
        return math.remainder(value - wanted, self.turn) if self.turn else value - wanted

    def check_constant(
        self, problem: OrbitProblem, u: NDArray[np.float64], size: float, most: float = CONSTANT
    ) -> None:
        """Raise `InputError` where the quantity is a state or output that varies along the orbit `u`.

        size: how much it varies with the states' sizes; most: range, over its size, up to which it is constant.
        """
        if self.kind != "constant":
            return
        survey = problem.survey(u)
        low, high = float(survey.lows[self.column]), float(survey.highs[self.column])
        if high - low > most * max(abs(low), abs(high), size):
            hint = f"fix 'max_{self.name}', 'min_{self.name}' or 'mean({self.name})'"
            what = f"{self.name} of the orbit, from {low:.6g} to {high:.6g}"
            raise InputError("fix", what, "a state or output that is constant along it", hint)


def read_quantity(system: HybridSystem, name: object) -> Quantity:
    """Return a quantity by its name, checked.

    Parameters
    ----------
    name : str
        ``period``; ``min_`` or ``max_`` and a state or output; an observable, as ``"mean(x)"``, or a formula in some. A
        state or output alone must be constant along the motion.

    Raises
    ------
    InputError
        There is no such quantity.

    Examples
    --------
    >>> from saltus.system.hybrid import HybridSystem, Mode
    >>> read_quantity(HybridSystem(("z",), {}, {"free": Mode({"z": "-z"})}), "max_z")
    Quantity(name='max_z', kind='max', column=0, turn=0.0)
    """
    name = checks.text("fix", name, f"the name of a quantity, as {_EXAMPLES}")
    if not name.isidentifier():
        formula = read_formula(system, name)
        return Quantity(name, "observable" if formula.expression is None else "formula", -1, formula.turn)
    phase = None if system.phase is None else system.phase[0]
    columns = {q: i for i, q in enumerate((*system.all_states, *system.output_names)) if q != phase}
    known = {q: Quantity(q, "constant", i) for q, i in columns.items()}
    for side in ("min", "max"):
        known = {f"{side}_{q}": Quantity(f"{side}_{q}", side, i) for q, i in columns.items()} | known
    known = {"period": Quantity("period", "period")} | known
    if name not in known:
        wanted = f"one of {', '.join(known)}, or an observable, as in 'mean({system.states[0]})'"
        hint = f"{name!r} is a parameter: set it in `parameters`" if name in system.parameters else nearest(name, known)
        raise InputError("quantity", name, wanted, hint)
    return known[name]


def sizes_of_unknowns(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return typical sizes of an orbit's states and durations, shape (size,)."""
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    return np.tile(np.append(problem.state_scale, max(period, 1e-300)), problem.segments)
