"""Options of a sweep: what is recorded at each value, and in which direction the values are followed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from saltus import checks
from saltus.errors import InputError
from saltus.flow.motion import tolerances_of
from saltus.flow.recurring.criteria import Criteria
from saltus.sweeps.section import Section

__all__ = ["PASSES", "SweepOptions"]

# Passes through the values, by `SweepOptions.follow`.
PASSES = {"up": ("up",), "down": ("down",), "both": ("up", "down"), "restart": ("restart",)}


@dataclass(frozen=True, kw_only=True)
class SweepOptions:
    """How `run_sweep` makes a sweep.

    Parameters
    ----------
    mode : str, optional
        Mode at the start; by default the first that the state allows.
    follow : {"up", "down", "both", "restart"}
        ``up`` follows the attractor from the first value to the last, ``down`` from the last to the first. ``both``
        makes the two passes, each from `x0`. ``restart`` starts every value at `x0`.
    chunks : int
        Stretches into which the values are cut, which are computed at the same time, each from `x0`. More than 1 may
        change which attractor is found.
    discard : int
        Returns to the section that are dropped, at the least.
    keep : int
        Returns that are kept. The label follows from as many, but no fewer than ``Criteria.looked_at``.
    section : str or Section, optional
        Where points are taken: before a transition of this name, or on a `Section`; by default at phase 0.
    quantities : sequence of str, optional
        Expressions in states, phase, parameters and outputs that are kept of each point; by default the states.
    observables : sequence of str
        What is observed at each value, as ``"amplitude(z, 1)"``; see `saltus.flow.observables`.
    exponents : int
        How many Lyapunov exponents, the largest first. Without a phase one is 0, that of the flow's direction.
    criteria : Criteria
        Thresholds of the labels.
    tolerance : float or (float, float)
        Relative tolerance of a step, or the relative and the absolute one. The default absolute tolerance is 1e-10. It
        is smaller in proportion to the smallest state where this is below 1e-2 at the first value, or later on.
    limit : float, optional
        Size beyond which a state that grows has diverged. By default as in `simulate`, by the problem at each value.
    lanes : bool, optional
        Whether motions that do not follow each other, of `chunks` or ``restart``, are followed side by side in vector
        lanes. By default where there are enough of them. Results are the same within the tolerance.
    workers : int, optional
        Threads that compute; by default one for each processor of this process. The result does not depend on it.
    client : dask.distributed.Client, optional
        A Dask cluster that computes in place of threads.

    Raises
    ------
    InputError
        An option that no sweep can have. `run_sweep` checks the options that depend on the system.

    Examples
    --------
    >>> SweepOptions(follow="both", discard=300).keep
    100
    """

    mode: str | None = None
    follow: str = "up"
    chunks: int = 1
    discard: int = 600
    keep: int = 100
    section: str | Section | None = None
    quantities: Sequence[str] | None = None
    observables: Sequence[str] = ()
    exponents: int = 1
    criteria: Criteria = field(default_factory=Criteria)
    tolerance: float | tuple[float, float] = 1e-8
    limit: float | None = None
    lanes: bool | None = None
    workers: int | None = None
    client: Any = None

    def __post_init__(self) -> None:
        checked: dict[str, Any] = {
            "follow": checks.chosen("SweepOptions.follow", self.follow, PASSES),
            "chunks": checks.count("SweepOptions.chunks", self.chunks),
            "discard": checks.count("SweepOptions.discard", self.discard, 0),
            "keep": checks.size("SweepOptions.keep", self.keep),
            "observables": checks.names("SweepOptions.observables", self.observables, "texts, as ['mean(v1)']"),
            "exponents": checks.count("SweepOptions.exponents", self.exponents),
        }
        if self.quantities is not None:
            allowed = "texts, as ['v1']"
            checked["quantities"] = checks.names("SweepOptions.quantities", self.quantities, allowed, least=1)
        if self.limit is not None:
            checked["limit"] = checks.positive("SweepOptions.limit", self.limit)
        if self.lanes is not None:
            checked["lanes"] = checks.instance("SweepOptions.lanes", self.lanes, bool)
        if self.workers is not None:
            checked["workers"] = checks.count("SweepOptions.workers", self.workers)
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        if self.section is not None and not isinstance(self.section, str | Section):
            raise InputError("SweepOptions.section", self.section, "the name of a transition, a Section, or None")
        if self.mode is not None:
            checks.text("SweepOptions.mode", self.mode)
        checks.instance("SweepOptions.criteria", self.criteria, Criteria)
        tolerances_of(self.tolerance, "SweepOptions.tolerance")
        if self.client is not None and self.workers is not None:
            raise InputError("SweepOptions.workers", self.workers, "left out where a client is given")
