"""Quantities of a periodic orbit by name, with their derivatives in the orbit's unknowns.

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
from saltus.flow.observables import dense_states, observe
from saltus.orbits.sampling import motion_of, steps_of
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.system import HybridSystem

__all__ = ["Quantity", "gradient_of", "read_quantity", "sizes_of_unknowns"]

_STEP = 2e-5  # change of an unknown, over its size, in differences of a quantity
_SHARES = 9  # places in a step among which an extreme is first sought
_ZOOMS = 8  # divisions of its neighbourhood, by eight each
_CONSTANT = 1e-7  # range of a state or output over a period, over its size, up to which it is constant
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
            return observe(motion_of(problem, u), (self.name,))[self.name]
        if self.kind == "constant":
            return 0.5 * float(survey.lows[self.column] + survey.highs[self.column])
        return float((survey.lows if self.kind == "min" else survey.highs)[self.column])

    @property
    def extreme(self) -> tuple[str, float] | None:
        """Expression and sign of an extreme, 1 for a maximum and -1 for a minimum; None of other quantities."""
        sides = {"max": 1.0, "min": -1.0}
        if self.kind in sides:
            return self.name.partition("_")[2], sides[self.kind]
        kind, _, rest = self.name.partition("(")
        known = self.kind == "observable" and kind.strip() in sides
        return (rest.strip()[:-1], sides[kind.strip()]) if known else None

    def beyond(self, value: float, wanted: float) -> float:
        """Return a value less a wanted one; of a phase the least angle between both."""
        return math.remainder(value - wanted, self.turn) if self.turn else value - wanted

    def check_constant(
        self, problem: OrbitProblem, u: NDArray[np.float64], size: float, most: float = _CONSTANT
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


def gradient_of(quantity: Quantity, problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives of a quantity in the unknowns and active parameters, shape (size + active,).

    They are central differences, but for the period's. A step is a share of the unknown's size; the flow stays on its
    meshes, so that differences are smooth. An extreme is differentiated where it is on the orbit `u`. Next to the
    orbit's start it may change places with the start of an orbit that is not closed yet, and have a kink there.
    """
    count = problem.size + len(problem.active)
    gradient = np.zeros(count)
    if quantity.kind == "period":
        gradient[problem.n : problem.size : problem.n + 1] = 1.0
        return gradient
    steps = _STEP * np.append(sizes_of_unknowns(problem, u), np.ones(len(problem.active)))
    extreme = quantity.extreme
    peak = None if extreme is None else _Peak(problem, u, *extreme)
    for i, step in enumerate(steps.tolist()):
        ends = []
        for side in (step, -step):
            moved = u.copy()
            moved[i] += side
            ends.append(quantity.value(problem, moved) if peak is None else peak.value(moved))
        gradient[i] = quantity.beyond(ends[0], ends[1]) / (2.0 * step)
    problem.set_parameters(u)
    return gradient


class _Peak:
    """Where on an orbit an expression, times a sign, is greatest: a segment and a clustered time."""

    def __init__(self, problem: OrbitProblem, u: NDArray[np.float64], expression: str, sign: float) -> None:
        self.problem, self._expression = problem, expression
        problem.survey(u)
        steps, share = steps_of(problem), np.linspace(0.0, 1.0, _SHARES)
        at = np.repeat(np.arange(len(steps.places)), _SHARES)
        states = dense_states(steps.starts[at], steps.dense[at], np.tile(share, len(steps.places)))
        values = sign * self._evaluated(states, problem.modes[steps.segments[at]], u)
        top = int(np.argmax(values))
        step = int(at[top])
        self.segment = int(steps.segments[step])
        self.place = float(steps.places[step] + steps.widths[step] * share[top % _SHARES])
        radius = float(steps.widths[step]) / (_SHARES - 1)
        for _ in range(_ZOOMS):
            places = np.clip(self.place + radius * np.linspace(-1.0, 1.0, 2 * _SHARES - 1), 0.0, 1.0)
            near = np.array([problem.state_on(self.segment, place) for place in places.tolist()])
            modes = np.full(len(near), problem.modes[self.segment])
            self.place = float(places[int(np.argmax(sign * self._evaluated(near, modes, u)))])
            radius /= _SHARES - 1

    def _evaluated(
        self, states: NDArray[np.float64], modes: NDArray[np.int64], u: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        system = self.problem.system
        parameters = dict(zip(system.parameter_names, self.problem.parameters_at(u).tolist(), strict=True))
        return evaluate(system, self._expression, states, modes, parameters)

    def value(self, u: NDArray[np.float64]) -> float:
        """Return the expression of an orbit nearby at the same place."""
        self.problem.survey(u)
        state = self.problem.state_on(self.segment, self.place)
        return float(self._evaluated(state[None, :], self.problem.modes[[self.segment]], u)[0])
