"""Events of a motion as one table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["GRAZING_SPEED", "code_of", "event_table", "indices_of"]

GRAZING_SPEED = 1e-6  # rate of an event function, in its unit per time, below which its event is marked as grazing


def event_table(
    system: HybridSystem,
    times: NDArray[np.float64],
    which: NDArray[np.int64],
    ends: NDArray[np.float64],
    rates: NDArray[np.float64],
) -> NDArray[np.void]:
    """Return the events of a motion as `Trajectory.events` has them, from arrays as `EventDrivenMotion.events` has."""
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
    table["grazing"] = ~wraps & (np.abs(rates) < GRAZING_SPEED)
    table.setflags(write=False)
    return table


def code_of(system: HybridSystem, kind: str, name: str) -> int:
    """Return the index of an event's transition; -1 for a wrap of the phase."""
    return -1 if kind == "phase" else system.transition_names.index(name)


def indices_of(names: tuple[str, ...], chosen: NDArray[np.str_]) -> NDArray[np.int64]:
    """Return the places of chosen names among all."""
    return np.array([names.index(name) for name in chosen], dtype=np.int64)
