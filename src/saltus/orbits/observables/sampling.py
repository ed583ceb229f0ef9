"""A periodic orbit from its segments' dense output: as a table against time, and as a motion to observe."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus import checks, scales as judged
from saltus.flow.stretch import POWERS_OF_TERMS, Motion, angle_of, clustered_clocks, dense_states
from saltus.orbits.rounds import rotating_of
from saltus.system.evaluate import evaluate
from saltus.system.own_states import absent_states

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["Steps", "column_of", "followed", "motion_of", "sample_orbit", "steps_of"]

_LOOKS = 17  # places in a step at which the defect of dense output is looked at
_FEWEST = 16  # fewest steps in a segment, so that a short one is still a curve


# Names that datasets of orbits use themselves.
_TAKEN = (
    "t", "mode", "state", "own_state", "quantity", "segment", "segment_state", "segment_duration", "segment_mode",
    "segment_transition", "multiplier", "multiplier_re", "multiplier_im", "x0", "minimum", "maximum",
)  # fmt: skip


def column_of(name: str) -> str:
    """Return the variable of an orbit's dataset in which a state or an output is: that of its name, where it is free.

    Examples
    --------
    >>> column_of("v"), column_of("mode")
    ('v', 'quantity_mode')
    """
    return f"quantity_{name}" if name in _TAKEN else name


def sample_orbit(problem: OrbitProblem, u: NDArray[np.float64], points: int = 400) -> xr.Dataset:
    """Return the orbit `u` over one period, from its segments' dense output.

    Parameters
    ----------
    problem : OrbitProblem
        Its equations, which last surveyed it.
    u : ndarray, shape (unknowns,)
        States and durations of the segments.
    points : int, optional
        About how many times, shared out by the segments' durations, 17 or more a segment.

    Returns
    -------
    xarray.Dataset
        Against the dimension ``t``, which starts at 0 with the first segment: every state (the phase modulo 2 pi),
        every output, and ``mode``, the index of the mode; `column_of` returns the names of the variables. Both ends of
        every segment are among the times, so that the time of an event occurs twice: before the reset, then after it.
        Times are closer near a segment's ends.

    Raises
    ------
    InputError
        `points` is no whole number, or less than 2.
    """
    from saltus.extras import xr

    points = checks.size("points", points, 2)
    system, parameters = problem.system, problem.named_at(u)
    times, states, modes = followed(problem, u, points)
    columns = dict(zip(system.all_states, states.T, strict=True))
    columns |= {name: evaluate(system, name, states, modes, parameters) for name in system.output_names}
    if system.phase is not None:
        columns[system.phase[0]] = states[:, -1] % system.turn
    dataset = xr.Dataset({column_of(name): ("t", column) for name, column in columns.items()}, coords={"t": times})
    dataset["mode"] = ("t", modes)
    dataset["mode"].attrs["names"] = ", ".join(system.mode_names)
    return dataset


def motion_of(problem: OrbitProblem, u: NDArray[np.float64]) -> Motion:
    """Return the orbit `u`, as `problem` last surveyed it, as `saltus.flow.observables` takes it.

    Parameters
    ----------
    problem : OrbitProblem
        Its equations.
    u : ndarray, shape (unknowns,)
        States and durations of the segments.
    """
    system, form, n = problem.system, problem.signature, problem.n
    blocks = u[: problem.size].reshape(problem.segments, n + 1)
    durations = blocks[:, n]
    ends = np.cumsum(durations)
    steps = steps_of(problem)
    duration, begun = durations[steps.segments], (ends - durations)[steps.segments]
    crossings, rate = [], np.empty(2)
    for index, transition in enumerate(form.transitions):
        if transition >= 0:
            x = np.ascontiguousarray(steps.ends[index])
            system.compiled.call("event", transition, 0, x, problem.extended, rate)
            crossings.append((float(ends[index]), transition, float(rate[1])))
    turns = form.turns or 1
    start = 0.0 if system.phase is None else angle_of(system, float(blocks[0, n - 1]), 0.0)[0]
    return Motion(
        system=system,
        parameters=problem.named_at(u),
        modes=problem.modes[steps.segments],
        clocks=clustered_clocks(begun, duration, steps.places, steps.widths),
        spans=np.tile([0.0, 1.0], (len(duration), 1)),
        states=lambda at, fractions: dense_states(steps.starts[at], steps.dense[at], fractions),
        crossings=crossings,
        angle=(start, 2.0 * math.pi * turns / float(ends[-1])),
        turns=turns,
        rotating=rotating_of(problem, u),
        tolerance=problem.tol,
        errors=cache(_Errors(problem, duration, steps)),
    )


class _Errors:
    """Errors of an orbit's states, computed when asked for: shape (state,)."""

    def __init__(self, problem: OrbitProblem, durations: NDArray[np.float64], steps: Steps) -> None:
        self._tol, self._scale = problem.tol, np.array(problem.state_scale)
        self._compiled, self._p = problem.system.compiled, problem.extended.copy()
        self._transitions, self._modes = problem.signature.transitions, problem.modes[steps.segments]
        self._durations, self._steps = durations, steps

    def __call__(self) -> NDArray[np.float64]:
        """Return what the steps of a period leave, dense output between them, and surfaces that are missed."""
        return np.asarray(np.maximum(judged.followed(self._tol) * self._scale + self._between(), self._missed()))

    def _between(self) -> NDArray[np.float64]:
        """Return by how much dense output departs from the flow between the nodes: its defect, integrated."""
        s, h, shares = self._steps.places[:, None], self._steps.widths[:, None], np.linspace(0.0, 1.0, _LOOKS)
        powers = POWERS_OF_TERMS @ self._steps.dense  # shape (step, power, state)
        places = np.tile(shares, (len(s), 1))
        states = dense_states(self._steps.starts, self._steps.dense, places)
        slopes = np.einsum("kj,mjn->mkn", np.arange(1, 8) * shares[:, None] ** np.arange(7), powers)
        rates, field = np.empty_like(states), np.empty(states.shape[2])
        for mode, rows, out in zip(self._modes.tolist(), states, rates, strict=True):
            for x, rate in zip(rows, out, strict=True):
                self._compiled.call("field", mode, 0, np.ascontiguousarray(x), self._p, field)
                rate[:] = field
        at = s + h * shares
        defects = slopes - (self._durations[:, None] * 6.0 * at * (1.0 - at) * h)[:, :, None] * rates
        gained = np.cumsum(0.5 * (defects[:, 1:] + defects[:, :-1]), axis=1) / (_LOOKS - 1)
        away = np.abs(gained - gained[:, -1:] * shares[1:, None])  # the nodes themselves are as exact as the steps
        return np.asarray(np.where(np.isfinite(away), away, 0.0).max(axis=(0, 1)))

    def _missed(self) -> NDArray[np.float64]:
        """Return the least changes of the states that put segments' ends onto their surfaces.

        What a flow magnifies, as the upstroke of a neuron, is seen there: the segment ends beside the surface.
        """
        n, found = self._scale.size, np.zeros(self._scale.size)
        event = np.empty(2 + 2 * n)
        for transition, end in zip(self._transitions, self._steps.ends, strict=True):
            if transition >= 0:
                self._compiled.call("event_x", transition, 0, np.ascontiguousarray(end), self._p, event)
                gradient = self._scale * event[2 : 2 + n]
                steep = float(gradient @ gradient)
                missed = self._scale * np.abs(event[0] * gradient) / steep if steep > 0.0 else np.zeros(n)
                found = np.maximum(found, np.where(np.isfinite(missed), missed, 0.0))
        return found


class Steps(NamedTuple):
    """Dense output: of each step its segment, clustered time, width, start, coefficients; of each segment its end."""

    segments: NDArray[np.intp]
    places: NDArray[np.float64]
    widths: NDArray[np.float64]
    starts: NDArray[np.float64]
    dense: NDArray[np.float64]
    ends: NDArray[np.float64]


def steps_of(problem: OrbitProblem) -> Steps:
    """Return the dense output that the last survey of a problem left, step by step."""
    mesh, mesh_at, nodes, coefficients = problem.dense()
    last = mesh_at[1:] - 1
    first = np.delete(np.arange(mesh.size), last)
    return Steps(
        np.repeat(np.arange(problem.segments), np.diff(mesh_at) - 1),
        mesh[first],
        mesh[first + 1] - mesh[first],
        nodes[first],
        coefficients[first],
        nodes[last],
    )


def followed(
    problem: OrbitProblem, u: NDArray[np.float64], points: int = 400
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return the orbit `u` as `sample_orbit` does, as arrays and without outputs.

    Parameters
    ----------
    problem, u, points
        As in `sample_orbit`.

    Returns
    -------
    times : ndarray, shape (time,)
    states : ndarray, shape (time, all states)
        Full states, the phase not wrapped; NaN for what a mode lacks.
    modes : ndarray of int, shape (time,)
        Indices of the modes.
    """
    steps, form = steps_of(problem), problem.signature
    heads = form.heads
    durations = u[: problem.size].reshape(problem.segments, problem.n + 1)[:, problem.n]
    begun, whole = 0.0, max(float(np.abs(durations).sum()), 1e-300)
    times, states, modes = [], [], []
    for index, (mode, duration) in enumerate(zip(form.modes, durations.tolist(), strict=True)):
        count = max(_FEWEST, round(points * abs(duration) / whole))
        s = np.linspace(0.0, 1.0, count + 1)
        times.append(begun + duration * s**2 * (3.0 - 2.0 * s))
        own = np.flatnonzero(steps.segments == index)
        at = own[np.searchsorted(steps.places[own], s, side="right") - 1]
        states.append(dense_states(steps.starts[at], steps.dense[at], (s - steps.places[at]) / steps.widths[at]))
        modes.append(np.full(count + 1, mode))
        begun += duration
        times[-1][-1] = begun
        if index not in heads:  # a cut is no place of its own
            times[-2], states[-2], modes[-2] = times[-2][:-1], states[-2][:-1], modes[-2][:-1]
    table, places = np.concatenate(states), np.concatenate(modes)
    for mode in np.unique(places).tolist():
        table[np.ix_(places == mode, absent_states(problem.system, mode))] = math.nan
    return np.concatenate(times), table, places
