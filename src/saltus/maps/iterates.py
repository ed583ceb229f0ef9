"""Iterates of a map from a state, as a result."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.described import described
from saltus.errors import InputError
from saltus.maps.code import LIMIT, STRETCH, MapCode, code_of, error_of
from saltus.maps.observing import observe_states
from saltus.result import Result, frozen
from saltus.system.angles import TURN
from saltus.system.evaluate import evaluate
from saltus.system.maps import Map
from saltus.system.plain import held_map, held_parameters

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike

__all__ = ["Iterates", "iterate", "keeps_turns", "path_from", "wound_path"]

_RUNS = 8  # stretches of an itinerary that a `repr` lists


@dataclass(frozen=True, eq=False, repr=False)
class Iterates(Result):
    """A motion of a map: a state and its images, one after the other; made by `iterate`.

    Attributes
    ----------
    system : Map
        The map.
    parameters : mapping of str to float
        All its parameters.
    first : int
        Iterations made before the first state.
    states : ndarray, shape (n + 1, state)
        The states. An angle counts its turns where the map takes a turn to a turn, and is else between -pi and pi.
    pieces : ndarray of int, shape (n + 1,)
        Index of the piece that holds at each state.

    Examples
    --------
    >>> import saltus
    >>> logistic = saltus.Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    >>> motion = saltus.iterate(logistic, x0=[0.1], n=1, discard=1000)
    >>> motion.states[:, 0].round(6).tolist()
    [0.513045, 0.799455]
    """

    system: Map
    parameters: Mapping[str, float]
    first: int
    states: NDArray[np.float64]
    pieces: NDArray[np.int64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "states", frozen(self.states))
        object.__setattr__(self, "pieces", frozen(self.pieces, np.int64))
        object.__setattr__(self, "parameters", checks.named_values("parameter", self.parameters))

    def __len__(self) -> int:
        return len(self.states)

    @property
    def steps(self) -> NDArray[np.int64]:
        """Iterations made before each state, shape (n + 1,)."""
        return np.arange(self.first, self.first + len(self.states))

    @property
    def itinerary(self) -> tuple[str, ...]:
        """Names of the pieces that the motion visits, one for each state."""
        names = self.system.piece_names
        return tuple(names[k] for k in self.pieces)

    @property
    def x_end(self) -> NDArray[np.float64]:
        """The last state, shape (state,)."""
        return np.asarray(self.states[-1])

    def output(self, expression: str) -> NDArray[np.float64]:
        """Return an output, or any expression, at each state.

        Parameters
        ----------
        expression : str
            In the states, parameters and outputs.

        Returns
        -------
        ndarray, shape (n + 1,)
            Its values.

        Raises
        ------
        InputError
            A text that is no expression, or an unknown name in it.
        """
        return evaluate(self.system, expression, self.states, self.pieces, self.parameters)

    def observe(self, *names: str) -> dict[str, float]:
        """Return observables of the motion.

        Parameters
        ----------
        *names : str
            Each ``max(e)``, ``min(e)`` or ``mean(e)`` of an expression, or ``fraction(piece)``, the share of the states
            at which a piece holds.

        Returns
        -------
        dict of str to float
            By name.

        Raises
        ------
        InputError
            No observable of a map, or an unknown name in it.

        Examples
        --------
        >>> doubling = Map(("x",), {}, {"x": "2*x*(1 - x)"})
        >>> iterate(doubling, x0=[0.5], n=3).observe("mean(x)")
        {'mean(x)': 0.5}
        """
        found = observe_states(self.system, self.parameters, self.states, self.pieces, names)
        return dict(zip(names, found, strict=True))

    def __repr__(self) -> str:
        n = len(self.states) - 1
        lines = [f"Iterates of {self.system.name or 'a map'}: iterations {self.first} to {self.first + n}"]
        for label, row in (("from", self.states[0]), ("to", self.states[-1])):
            values = ", ".join(f"{name} = {value:.9g}" for name, value in zip(self.system.states, row, strict=True))
            lines.append(f"  {label:5s} {values}")
        if self.system.is_piecewise:
            edges = np.flatnonzero(np.diff(self.pieces)) + 1
            runs = np.split(self.pieces, edges)
            shown = [
                f"{self.system.piece_names[run[0]]}{f' x{len(run)}' if len(run) > 1 else ''}" for run in runs[:_RUNS]
            ]
            more = f", ... ({len(runs) - _RUNS} more)" if len(runs) > _RUNS else ""
            lines.append(f"  pieces {', '.join(shown)}{more}")
        return "\n".join(lines)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset with the dimensions iteration and state."""
        from saltus.extras import xr

        named = json.dumps(dict(enumerate(self.system.piece_names)))
        return xr.Dataset(
            {
                "x": (("iteration", "state"), np.array(self.states)),
                "piece": ("iteration", np.array(self.pieces), {"meaning": named}),
            },
            coords={"iteration": self.steps, "state": list(self.system.states)},
            attrs={
                "definition": json.dumps(self.system.definition()),
                "parameters": json.dumps(dict(self.parameters)),
                "first": self.first,
            },
        )

    @classmethod
    def _read(cls, held: Contents) -> Iterates:
        system = held_map(held)
        held.names("state", system.states)
        count, first = held.size("iteration", least=1), held.count("first")
        steps = held.array("iteration", ("iteration",), int, least=0)
        if not np.array_equal(steps, np.arange(first, first + count)):
            raise InputError("variable 'iteration'", steps[:4].tolist(), f"counted from {first} on")
        return cls(
            system,
            held_parameters(held, system),
            first,
            held.array("x", ("iteration", "state")),
            held.array("piece", ("iteration",), int, least=0, most=len(system.pieces) - 1),
        )


def iterate(
    system: Map,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike = (),
    *,
    n: int = 100,
    discard: int = 0,
) -> Iterates:
    """Return a state and its images under a map.

    Parameters
    ----------
    system : Map
        The map.
    parameters : mapping of str to float, optional
        Parameters that differ from the defaults.
    x0 : array_like, shape (states,), or mapping of str to float
        The state.
    n : int, optional
        How many iterations are kept.
    discard : int, optional
        How many are made before; these take no memory.

    Returns
    -------
    Iterates
        ``n + 1`` states, the first after `discard` iterations.

    Raises
    ------
    InputError
        An argument that cannot be used, as a hybrid system in the place of the map.
    DefinitionError
        A state is met at which no piece holds, or several do.
    MapDivergenceError
        A component of the state grows beyond 1e100, or is no number.

    Examples
    --------
    >>> logistic = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    >>> found = iterate(logistic, x0=[0.3], n=3, discard=1000)
    >>> print(found.states[:, 0].round(6))
    [0.799455 0.513045 0.799455 0.513045]
    """
    hint = "simulate follows a HybridSystem" if hasattr(system, "transitions") else ""
    system = checks.instance("system", system, Map, hint)
    x = system.full_state(x0)
    kept, dropped = checks.size("n", n, 0), checks.count("discard", discard, 0)
    p = system.parameter_vector(parameters)
    states, pieces, turns = wound_path(system, p, code_of(system, p), x, dropped, kept + 1)
    if turns.any() and keeps_turns(system, p, states, pieces):
        states[:, system.angle_places] += TURN * turns
    return Iterates(system, system.resolve(parameters), dropped, states, pieces)


def path_from(
    system: Map, p: NDArray[np.float64], code: MapCode, x: NDArray[np.float64], discard: int, count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return states of a motion, shape (count, states), the first after `discard` iterations, and their pieces.

    Angles are between -pi and pi.

    Raises
    ------
    DefinitionError, MapDivergenceError
        As `iterate`.
    """
    return wound_path(system, p, code, x, discard, count)[:2]


def wound_path(
    system: Map, p: NDArray[np.float64], code: MapCode, x: NDArray[np.float64], discard: int, count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return what `path_from` does, and the whole turns taken away from each angle so far, shape (count, angles).

    An image is that of angles between -pi and pi: each step rounds alike, however far a motion has gone round.
    """
    from saltus.maps.kernels import steps as kernels  # with Numba, which takes its time

    states, pieces = np.empty((count, len(system.states))), np.empty(count, np.int64)
    wound, turns = np.zeros(code.circles.size), np.zeros((count, code.circles.size))
    at, made = np.array(x, dtype=np.float64), 0
    while True:
        some = min(discard - made, STRETCH)
        rows = slice(None) if made + some == discard else slice(0)
        status, step = kernels.path(
            at, np.empty_like(at), code, LIMIT, some, states[rows], pieces[rows], wound, turns[rows]
        )
        if status != kernels.DONE:
            raise error_of(status, made + step, at, system, p)
        if len(states[rows]):
            return states, pieces, turns
        made += some


def keeps_turns(system: Map, p: NDArray[np.float64], states: NDArray[np.float64], pieces: NDArray[np.int64]) -> bool:
    """Return whether a turn of each angle is a turn of its image, and of no other angle: then turns can be counted.

    It is looked at in each piece that a motion visits, at the first state there.
    """
    places = system.angle_places
    for piece, first in zip(*np.unique(pieces, return_index=True), strict=True):
        x = np.ascontiguousarray(states[first])
        image = system.compiled.field(int(piece), x, p)
        for place in places:
            on = x.copy()
            on[place] += TURN
            gone = (system.compiled.field(int(piece), on, p) - image)[places] / TURN
            if not np.array_equal(np.round(gone), (places == place).astype(float)):
                return False
    return True
