"""What the page offers for a system, by its kind: a kind registers here what is looked for, drawn and followed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import singledispatch
from typing import TYPE_CHECKING, Any

from saltus.explorer.steps import FindEquilibrium, FindOrbit, Iterate, Move
from saltus.explorer.visits import COUNT, NEXT
from saltus.system import Map

if TYPE_CHECKING:
    from saltus.explorer.steps import Step
    from saltus.system import HybridSystem

__all__ = ["Kind", "kind_of", "motion_instead", "motion_step"]

_WORDS = ("periodic attractor", "stable orbit")  # what was not found, in the words of the errors
# What can be set; see `saltus.explorer.numerics.Numerics`.
_NUMERICS = ("largest", "deviation", "max_points", "settle", "discard", "keep")


@dataclass(frozen=True)
class Kind:
    """What a kind of system allows, and how it is shown."""

    first: type[FindOrbit | FindEquilibrium]  # what a session begins with
    nearby: str  # what is looked for near the start, ``"equilibrium"`` or ``"orbit"``; empty for nothing
    time: str  # what the axis of time is called
    upwards: str  # what a portrait shows upwards where the system has one state
    unit: str  # in what the length of a motion is counted
    span: float  # how long a motion is at first
    long: float  # how long one is that shows an attractor
    cell: float  # how long one is that starts at a cell of a basin; see `span_of_cell`
    start: float = 0.0  # each state of a first start
    chosen_modes: bool = True  # whether a start may choose its mode
    own_time: bool = False  # whether time has no unit but that of a solution
    section: bool = False  # whether a sweep needs a section
    layers: tuple[str, ...] = ("field", "nullclines", "surfaces", "live")  # what may be drawn below a motion
    extremes: bool = True  # whether axes of diagrams offer extremes of states and outputs
    numerics: tuple[str, ...] = (*_NUMERICS, "tolerance", "section")  # numbers that may be set

    def span_of_cell(self, solution: Any) -> float:
        """Return how long a motion is that starts at a cell of a basin of a solution."""
        return self.cell * (float(getattr(solution, "period", 1.0)) if self.own_time else 1.0)


@singledispatch
def kind_of(system: Any) -> Kind:
    """Return what the page offers for a system.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> kind_of(HybridSystem.smooth({"x": "-x"})).nearby, kind_of(Map(("x",), {}, {"x": "x/2"})).nearby
    ('equilibrium', 'orbit')
    """
    if system.phase is not None:
        return Kind(FindOrbit, "", "t", "t", "periods", 20.0, 200.0, 60.0)
    first = FindOrbit if system.transitions else FindEquilibrium
    return Kind(first, "equilibrium", "t", "t", "time", 50.0, 200.0, 30.0, own_time=True, section=True)


@kind_of.register
def _(system: Map) -> Kind:
    return Kind(
        FindOrbit, "orbit", COUNT, NEXT + system.states[0], "iterations", 100.0, 2000.0, 200.0, start=0.1,
        chosen_modes=False, layers=(), extremes=False, numerics=_NUMERICS,
    )  # fmt: skip


@singledispatch
def motion_step(
    system: Any, parameters: Mapping[str, float], x0: tuple[float, ...], mode: str | None, span: float
) -> Move | Iterate:
    """Return the step that follows the motion from a state.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float
        Parameters that differ from the system's own.
    x0 : tuple of float
        The state.
    mode : str or None
        The mode there.
    span : float
        How long, in the unit of `Kind`.

    Examples
    --------
    >>> motion_step(Map(("x",), {}, {"x": "x/2"}), {}, (1.0,), None, 30.0).text()
    'saltus.iterate(system, {}, [1.0], n=30)'
    """
    lasts: dict[str, Any] = {"t_end": span} if system.phase is None else {"periods": max(round(span), 1)}
    return Move(parameters=dict(parameters), x0=x0, mode=mode, **lasts)


@motion_step.register
def _(
    system: Map, parameters: Mapping[str, float], x0: tuple[float, ...], mode: str | None, span: float
) -> Move | Iterate:
    return Iterate(parameters=dict(parameters), x0=x0, n=max(round(span), 1))


def motion_instead(step: Step | None, error: str, system: HybridSystem | Map) -> Move | Iterate | None:
    """Return a step that shows the motion from the start of a search that found no periodic attractor.

    Parameters
    ----------
    step : Step or None
        The step that failed.
    error : str
        What it said.
    system : HybridSystem or Map
        The system.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> still = HybridSystem.smooth({"x": "v", "v": "-x"})
    >>> motion_instead(FindOrbit(x0=(1.0, 0.0)), "no periodic attractor", still).text()
    'saltus.simulate(system, {}, [1.0, 0.0], t_end=200.0)'
    """
    if not isinstance(step, FindOrbit) or not any(words in error for words in _WORDS):
        return None
    return motion_step(system, step.parameters, step.x0, step.mode, kind_of(system).long)
