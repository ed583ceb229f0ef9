"""How an orbit's flow is discretised: meshes of its segments, the kind of their steps, and how meshes are moved."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.orbits.frames import linear_frames, merged, pieces
from saltus.orbits.meshes import FEW, decays_along, joined, stabilised

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from saltus.orbits.frames import Frames
    from saltus.orbits.meshes import Decay
    from saltus.orbits.signature import Survey
    from saltus.system import HybridSystem

__all__ = ["Dense", "Discretised"]

_MOST_SLIDING = 20_000  # steps of an orbit that slides, beyond which it comes too near to a two-fold
_MOVES = 4  # of meshes of explicit steps until steps in frames have about equal errors
_SETTLING = 6  # of meshes in a row until steps are cut only
_LONGER = 0.05  # change of a duration from which the dense output is laid out anew
_DISCRETISATION = (
    "mesh", "stiff", "linear", "state_scale", "_largest", "_least", "moved_by", "bent", "_atol", "_nearest", "_decays",
    "_shares", "_surface_rows", "begun", "_explicit", "relaxes", "begun_durations", "_lasting",
)  # fmt: skip

Dense = tuple["NDArray[np.float64]", "NDArray[np.int64]", "NDArray[np.float64]", "NDArray[np.float64]"]
"""Mesh (node,), offsets of the segments' meshes, states (node, n) and coefficients (node, 7, n)."""


class Discretised(ABC):
    """The meshes of an orbit's equations."""

    system: HybridSystem
    n: int  # components of the full state
    segments: int
    modes: NDArray[np.int64]  # shape (segments,)
    transitions: NDArray[np.int64]  # shape (segments,): events at their ends, -1 for none
    extended: NDArray[np.float64]  # parameters with constants behind them
    begun: Survey
    begun_durations: NDArray[np.float64]  # shape (segments,): durations of which decays are known
    mesh: tuple[NDArray[np.float64], NDArray[np.int64]]  # clustered times, and where each segment's begin
    stiff: bool  # whether steps are implicit
    relaxes: bool  # whether pieces contract so far that they are cut for growth alone, and start on planes
    linear: Frames | None  # parts of the modes' fields in whose frames steps are taken
    _active: NDArray[np.int64]
    _slides: bool
    _meshes: Any
    _errors: NDArray[np.float64]
    _worst: float
    _looked: int
    _rough: bool  # whether meshes that are moved do not settle
    _unsettled: int  # moves of meshes in a row that left them too coarse
    _unsteady: bool  # whether steps have been too long for stability where many are short
    _decays: list[float | Decay]
    _dense: tuple[NDArray[np.float64], NDArray[np.float64]]
    _seen: tuple[NDArray[np.float64], NDArray[np.float64]]  # unknowns and mesh of the last survey
    # mesh and durations that the dense output's meshes were laid out for, and these
    _split: tuple[NDArray[np.float64], NDArray[np.float64], tuple[NDArray[np.float64], NDArray[np.int64]]]
    _lasting: NDArray[np.float64]  # shape (segments,): durations at the last survey
    _explicit: tuple[NDArray[np.float64], NDArray[np.int64]]

    @abstractmethod
    def _adapt(self, u: NDArray[np.float64]) -> int | None:
        """Make meshes anew; return a segment that cannot be followed."""

    @abstractmethod
    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian."""

    @abstractmethod
    def resolve(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what `evaluate` does, on meshes that are fine enough."""

    @abstractmethod
    def set_parameters(self, u: NDArray[np.float64]) -> None:
        """Take the active parameters from the unknowns."""

    @abstractmethod
    def dense(self) -> Dense:
        """Return the dense output that the last survey left."""

    @abstractmethod
    def survey(self, u: NDArray[np.float64]) -> Survey:
        """Return what a dense look at an orbit shows."""

    @property
    def surveyed(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The meshes of the dense output: clustered times, and where each segment's begin."""
        if self.linear is None:
            return self.mesh
        places, lasting, laid = self._split
        moved = np.abs(lasting - self._lasting) > _LONGER * lasting
        if places is not self.mesh[0] or np.any(moved):
            laid = joined(pieces(self.mesh, self.modes, self._lasting, self.linear))
            self._split = self.mesh[0], self._lasting, laid
        return laid

    def _choose_frames(self, u: NDArray[np.float64], blocks: NDArray[np.float64]) -> None:
        """Go on by steps in the frames of linear parts, where these cost less; loci have none."""
        self._explicit = self.mesh
        if self.stiff or self._active.size > 1:
            return
        _, starts, nodes, _ = self.dense()
        durations = np.abs(blocks[:, self.n])
        linear = linear_frames(self.system, self.modes, durations, (starts, nodes), self.extended)
        if linear is not None:
            self.linear, self._lasting = linear, durations
            self._use(*joined(merged(self.mesh, self.modes, linear)))
            for _ in range(_MOVES):
                self.evaluate(u)
                self._move(0.0)
            self.begun = self.survey(u)

    @contextmanager
    def explicit_steps(self, u: NDArray[np.float64]) -> Iterator[None]:
        """Follow the orbit `u` by explicit steps for a while, as second derivatives and variations need them."""
        if self.linear is None:
            yield
            return
        held, errors, worst = self.kept(), self._errors, self._worst
        self.linear = None
        self._use(*self._explicit)
        self.resolve(u)
        self._explicit = self.mesh
        try:
            yield
        finally:
            explicit = self._explicit
            self.take(held)
            self._explicit = explicit
            self._errors, self._worst = errors, worst

    @contextmanager
    def halved_steps(self) -> Iterator[None]:
        """Follow orbits by steps of half the length for a while: what changes is the error of the steps."""
        held, told = self.kept(), (self._errors, self._worst, self._unsettled)
        self._cut_at(np.delete(np.arange(self.mesh[0].size), self.mesh[1][1:] - 1))
        try:
            yield
        finally:
            self.take(held)
            self._errors, self._worst, self._unsettled = told

    def kept(self) -> dict[str, Any]:
        """Return the meshes and sizes, for `take`."""
        return {name: _apart(getattr(self, name)) for name in _DISCRETISATION}

    def take(self, kept: Mapping[str, Any]) -> None:
        """Take meshes and sizes that were kept."""
        for name, value in kept.items():
            setattr(self, name, _apart(value))
        self._errors = np.zeros(self.mesh[0].size)

    def _use(self, places: NDArray[np.float64], starts: NDArray[np.int64]) -> None:
        begun = self.begun_durations
        longer = np.divide(self._lasting, begun, out=np.ones(begun.size), where=begun > 0.0)
        steady = (places, starts) if self.stiff else stabilised(places, starts, self._decays, longer)
        self.mesh = steady if steady[0].size <= max(places.size, self._meshes.MOST_NODES) else (places, starts)
        self._errors = np.zeros(self.mesh[0].size)

    def _curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the arrays of the dense output, as long as the meshes are."""
        nodes = self.surveyed[0].size
        if self._dense[0].size != nodes * self.n:
            self._dense = np.empty(nodes * self.n), np.empty(nodes * 7 * self.n)
        return self._dense

    def _followed(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the dense output of the last survey, which is made again where the meshes have moved since."""
        u, places = self._seen
        now = self.surveyed[0]
        if u.size and places is not now and not np.array_equal(places, now):
            self.survey(u)
        return self._curve()

    @property
    def worst(self) -> float:
        """Largest error of a step at the last evaluation, in tolerances."""
        return self._worst

    @property
    def steps(self) -> int:
        """Steps in all segments' meshes."""
        return int(self._errors.size - self.segments)

    @property
    def crowded(self) -> bool:
        """Whether an orbit that slides takes so many steps that it comes too near to a two-fold."""
        return self._slides and self.steps > _MOST_SLIDING

    def refine(self, *, met: bool = True) -> bool:
        """Return whether the meshes were fine enough at the last evaluation, and move them to equal errors if not.

        met: whether the segments ended at their events there, so that steps beside these count.
        """
        if self._worst <= self._meshes.FINEST:
            self._unsettled = 0
            return True
        self._unsettled += 1
        self._rough = self._rough or self._unsettled > _SETTLING
        unstable = not self._worst <= self._meshes.UNSTABLE
        self._unsteady |= unstable and not self.stiff and self.steps >= FEW * self.segments
        if self._rough and not unstable:
            self._cut_steps()
            return False
        fine = self._move(self._meshes.FINEST, met=met)
        self._unsettled *= not fine
        return fine

    def _cut_steps(self) -> None:
        """Cut in half the steps whose errors are too large, and leave all others as they are.

        Meshes that are moved again and again need not settle: next to the limit of stability errors know no order.
        """
        large = self._errors > self._meshes.FINEST
        large[self.mesh[1][1:] - 1] = False  # no step begins at a segment's end
        self._cut_at(np.flatnonzero(large))

    def _cut_at(self, cut: NDArray[np.intp]) -> None:
        """Cut in half the steps that begin at some nodes."""
        places, starts = self.mesh
        middles = 0.5 * (places[cut] + places[cut + 1])
        self._use(np.insert(places, cut + 1, middles), starts + np.searchsorted(cut, starts))

    def prepare(self, u: NDArray[np.float64]) -> None:
        """Move the meshes to equal errors where they may soon be too coarse, or are finer than they need be.

        Those of a stiff flow, whose fast layers move through their steps, are made anew for `u`.
        """
        if self.stiff:
            self.set_parameters(u)
            self._adapt(u)
        elif not self.stabilise(u):
            if self._unsteady and self.linear is None:
                self.survey(u)
                self._follow_decays(u, range(self.segments))
            self._move(1.0)

    def _follow_decays(self, u: NDArray[np.float64], which: Iterable[int]) -> None:
        """Look at the decays of some segments all along the orbit `u`, as last surveyed."""
        places, starts, nodes, _ = self.dense()
        blocks = u[: self.segments * (self.n + 1)].reshape(self.segments, self.n + 1)
        for i in which:
            own, duration = slice(starts[i], starts[i + 1]), np.minimum(abs(blocks[i, self.n]), self.begun_durations[i])
            given = self.extended, float(duration)
            self._decays[i] = decays_along(self.system.compiled, int(self.modes[i]), nodes[own], places[own], given)

    def stabilise(self, u: NDArray[np.float64]) -> bool:
        """Go on by implicit steps where explicit ones have become many and cost more; return whether they are new."""
        if self.stiff or self.linear is not None or self.steps < max(FEW * self.segments, 2 * self._looked):
            return False
        self.set_parameters(u)
        held, errors, worst = self.kept(), self._errors, self._worst
        self._adapt(u)
        self._looked = self.steps
        if not self.stiff:  # a new mesh of explicit steps has no errors yet by which it could be moved
            self.take(held)
            self._errors, self._worst, self._looked = errors, worst, self.steps
        return self.stiff

    def _move(self, limit: float, *, met: bool = True) -> bool:
        (places, starts), most = self.mesh, FEW * self.segments
        fresh, ends = np.empty(3 * places.size + 8 * self.segments), np.empty_like(starts)
        given = places, starts, self.transitions, self._errors, limit, self._worst, met, most
        fine, count = self._meshes.moved(*given, fresh, ends)
        # a flow that diverges has errors that are no numbers, and by these no mesh
        if 0 < count <= max(places.size, self._meshes.MOST_NODES) and np.isfinite(fresh[:count]).all():
            self._use(fresh[:count].copy(), ends)
        return bool(fine)


def _apart(value: Any) -> Any:
    return value.copy() if isinstance(value, np.ndarray) else value
