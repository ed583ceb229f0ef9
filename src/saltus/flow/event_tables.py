"""Events of a motion as one table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import SPEEDLESS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["code_of", "event_table", "indices_of"]


def event_table(
    system: HybridSystem,
    times: NDArray[np.float64],
    which: NDArray[np.int64],
    ends: NDArray[np.float64],
    rates: NDArray[np.float64],
    p: NDArray[np.float64],
    starts: NDArray[np.float64],
    t_end: float,
) -> NDArray[np.void]:
    """Return the events of a motion as `Trajectory.events` has them, from arrays as `EventDrivenMotion.events` has.

    Parameters
    ----------
    p : ndarray, shape (parameters,)
        Parameters, extended or not.
    starts : ndarray, shape (step, all states)
        States on the way, whose sizes tell how fast an event function changes.
    t_end : float
        When the motion ends.
    """
    n = len(system.all_states)
    names = (*system.transition_names, "" if system.phase is None else system.phase[0])
    modes = np.array(system.mode_names)
    longest = max(1, *map(len, names))
    table = np.zeros(
        times.size,
        dtype=[
            ("time", "f8"), ("kind", "U5"), ("name", f"U{longest}"), ("mode_before", modes.dtype),
            ("mode_after", modes.dtype), ("before", "f8", (n,)), ("after", "f8", (n,)), ("normal_velocity", "f8"),
            ("grazing", "?"),
        ],
    )  # fmt: skip
    wraps = which[:, 0] < 0
    table["time"], table["before"], table["after"], table["normal_velocity"] = times, ends[:, 0], ends[:, 1], rates
    table["kind"] = np.where(wraps, "phase", "event")
    table["name"] = np.array(names)[which[:, 0]]
    table["mode_before"], table["mode_after"] = modes[which[:, 1]], modes[which[:, 2]]
    table["grazing"] = _are_grazing(system, times, which[:, 0], ends, rates, p, starts, t_end)
    table.setflags(write=False)
    return table


def _are_grazing(
    system: HybridSystem,
    times: NDArray[np.float64],
    transitions: NDArray[np.int64],
    ends: NDArray[np.float64],
    rates: NDArray[np.float64],
    p: NDArray[np.float64],
    starts: NDArray[np.float64],
    t_end: float,
) -> NDArray[np.bool_]:
    """Return which events are met without speed: what it makes in the longest flight is nothing of the states' sizes.

    With a phase no flight counts as longer than its turn.
    """
    n, happens = ends.shape[2], transitions >= 0
    sizes = np.abs(np.concatenate([ends.reshape(-1, n), starts])).max(axis=0, initial=0.0)
    longest = float(np.diff(times, prepend=0.0, append=max(t_end, times.max(initial=0.0))).max())
    extended, out = system.compiled.extended(p[: len(system.parameters)]), np.empty(2 + 2 * n)
    found = np.zeros(rates.size, dtype=np.bool_)
    for i in np.flatnonzero(happens).tolist():
        system.compiled.call("event_x", int(transitions[i]), 0, np.ascontiguousarray(ends[i, 0]), extended, out)
        found[i] = abs(rates[i]) * longest < SPEEDLESS * float(np.abs(out[2 : 2 + n]) @ sizes)
    return found


def code_of(system: HybridSystem, kind: str, name: str) -> int:
    """Return the index of an event's transition; -1 for a wrap of the phase."""
    return -1 if kind == "phase" else system.transition_names.index(name)


def indices_of(names: tuple[str, ...], chosen: NDArray[np.str_]) -> NDArray[np.int64]:
    """Return the places of chosen names among all."""
    return np.array([names.index(name) for name in chosen], dtype=np.int64)
