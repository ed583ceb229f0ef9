"""Results of a sweep: points on the section, labels, exponents and observables at each value."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.described import described
from saltus.errors import InputError
from saltus.result import Result, frozen
from saltus.system import HybridSystem, Map
from saltus.system.plain import held_any, held_parameters, swept_parameter

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Sweep", "SweptValue"]

_LISTED = 24  # runs of labels that a `repr` lists for each pass


class SweptValue(NamedTuple):
    """Results of a sweep at one value.

    Attributes
    ----------
    parameters : mapping of str to float
        All parameters.
    label : str
        Label of the motion.
    period : int
        Returns after which it recurs, 0 where it does not.
    rotation : float
        Rotation number, or NaN.
    exponents : ndarray, shape (exponent,)
        Largest Lyapunov exponents per unit of time.
    points : mapping of str to ndarray, shape (kept,)
        The quantities on the section.
    observed : mapping of str to float
        The observables.
    state : ndarray, shape (all states,)
        Full state at the end, from which the motion at the next value starts.
    mode : str
        Mode at the end; empty where there is no motion.
    reason : str
        Reason why there is no motion.
    """

    parameters: Mapping[str, float]
    label: str
    period: int
    rotation: float
    exponents: NDArray[np.float64]
    points: Mapping[str, NDArray[np.float64]]
    observed: Mapping[str, float]
    state: NDArray[np.float64]
    mode: str
    reason: str


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Result):
    """Attractors along a parameter, by simulation; made by `run_sweep`.

    Every array has a row for each direction and value: NaN, empty or 0 where nothing was computed.

    Attributes
    ----------
    system : HybridSystem or Map
        The system.
    parameter : str
        The swept parameter, or a group of parameters.
    values : ndarray, shape (value,)
        Its values, ascending.
    parameters : mapping of str to float
        All parameters at the first value.
    directions : tuple of str
        The passes: "up", "down", or "restart" where every value starts anew.
    quantities : tuple of str
        Quantities kept of each point.
    points : ndarray, shape (direction, value, kept, quantity)
        The quantities at the returns kept.
    labels : ndarray of str, shape (direction, value)
        Label of the motion, by the criteria of `saltus.flow.motion_kind`. Empty where it was not computed.
    periods : ndarray of int, shape (direction, value)
        Returns after which it recurs, 0 where it does not.
    rotations : ndarray, shape (direction, value)
        Rotation number in turns per return, where the motion is quasi-periodic or locked.
    curves : ndarray of int, shape (direction, value)
        Closed curves on the section to which the rotation number refers.
    exponents, errors : ndarray, shape (direction, value, exponent)
        Largest Lyapunov exponents per unit of time or per iteration, and half widths of their 95 % intervals.
    return_times : ndarray, shape (direction, value)
        Mean time between returns; 1 for a map.
    observables : tuple of str
        Observables measured at each value.
    observed : ndarray, shape (direction, value, observable)
        Its values.
    reasons : ndarray of str, shape (direction, value)
        Reason why there is no motion, where there is none, or why it is unresolved.
    states : ndarray, shape (direction, value, all states)
        Full states at the end of each value, from which the motion at the next value starts.
    modes : ndarray of int, shape (direction, value)
        Indices of the modes, or pieces of a map, at the end; -1 where there is no motion.
    settings : mapping
        Options of `run_sweep`, thresholds included. Without a given one, ``atol`` is the absolute tolerance that fits
        the motion at the first value. Motions with far smaller states are followed by finer ones.
    stopped : str
        Why the sweep ended, in words.

    Examples
    --------
    >>> import saltus
    >>> logistic = saltus.Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    >>> sweep = saltus.run_sweep(logistic, "r", [3.2, 3.5], x0=[0.3])
    >>> sweep.labels.tolist()
    [['period-2', 'period-4']]
    """

    system: HybridSystem | Map
    parameter: str
    values: NDArray[np.float64]
    parameters: Mapping[str, float]
    directions: tuple[str, ...]
    quantities: tuple[str, ...]
    points: NDArray[np.float64]
    labels: NDArray[np.str_]
    periods: NDArray[np.int64]
    rotations: NDArray[np.float64]
    curves: NDArray[np.int64]
    exponents: NDArray[np.float64]
    errors: NDArray[np.float64]
    return_times: NDArray[np.float64]
    observables: tuple[str, ...]
    observed: NDArray[np.float64]
    reasons: NDArray[np.str_]
    states: NDArray[np.float64]
    modes: NDArray[np.int64]
    settings: Mapping[str, Any]
    stopped: str

    def __post_init__(self) -> None:
        for name in ("values", "points", "rotations", "exponents", "errors", "return_times", "observed", "states"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        for name in ("periods", "curves", "modes"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))
        for name in ("labels", "reasons"):
            object.__setattr__(self, name, frozen(getattr(self, name), str))
        for name in ("parameters", "settings"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def done(self) -> NDArray[np.bool_]:
        """Where a value has been computed, shape (direction, value)."""
        return np.asarray(self.labels != "")

    def at(self, value: float, direction: str | None = None) -> SweptValue:
        """Return the results at the value nearest to the given one.

        Parameters
        ----------
        value : float
            Between the first value and the last.
        direction : str, optional
            The pass; by default the first.

        Returns
        -------
        SweptValue
            Label, points, exponents and observables at that value.

        Raises
        ------
        InputError
            A value outside, a pass that was not made, or a value that was not computed.
        """
        i = self._row(direction)
        low, high = float(self.values[0]), float(self.values[-1])
        value = checks.number("value", value, f"between {low:g} and {high:g}")
        if not low <= value <= high:
            raise InputError("value", value, f"between {low:g} and {high:g}")
        k = int(np.argmin(np.abs(self.values - value)))
        if not self.labels[i, k]:
            raise InputError("value", value, "one that was computed", self.stopped)
        mode = int(self.modes[i, k])
        swept = self.system.resolve({**self.parameters, self.parameter: float(self.values[k])})
        return SweptValue(
            MappingProxyType(swept),
            str(self.labels[i, k]),
            int(self.periods[i, k]),
            float(self.rotations[i, k]),
            self.exponents[i, k],
            MappingProxyType(dict(zip(self.quantities, self.points[i, k].T, strict=True))),
            MappingProxyType(dict(zip(self.observables, self.observed[i, k].tolist(), strict=True))),
            self.states[i, k],
            self.system.mode_names[mode] if mode >= 0 else "",
            str(self.reasons[i, k]),
        )

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity or an observable.

        Parameters
        ----------
        name : str
            As `run_sweep` was given it.

        Returns
        -------
        ndarray, shape (direction, value, kept) or (direction, value)
            The first shape for a quantity, the second for an observable.

        Raises
        ------
        InputError
            The quantity or observable was not recorded.
        """
        checks.chosen("quantity", name, (*self.quantities, *self.observables))
        if name in self.quantities:
            return self.points[..., self.quantities.index(name)]
        return self.observed[..., self.observables.index(name)]

    def runs(self, direction: str | None = None) -> list[tuple[str, float, float, int]]:
        """Return the stretches of equal labels of a pass.

        Parameters
        ----------
        direction : str, optional
            The pass; by default the first.

        Returns
        -------
        list of tuple
            Label, first and last value, count of values.

        Raises
        ------
        InputError
            A pass that was not made.
        """
        found, k = [], 0
        for label, group in groupby(self.labels[self._row(direction)].tolist()):
            count = len(list(group))
            found.append((str(label), float(self.values[k]), float(self.values[k + count - 1]), count))
            k += count
        return found

    def _row(self, direction: str | None) -> int:
        if direction is None:
            return 0
        return self.directions.index(checks.chosen("direction", direction, self.directions))

    def __repr__(self) -> str:
        count, settings = len(self.values), self.settings
        name = self.system.name or self.system.unnamed
        section = settings["section"]
        what = self.system.natural_returns if section is None else f"returns to {_told(section)}"
        lines = [
            f"Sweep of {name}: {self.parameter} from {self.values[0]:.6g} to {self.values[-1]:.6g}, "
            f"{count} {'value' if count == 1 else 'values'}, {' and '.join(self.directions)}",
            f"  {settings['discard']} {what} dropped, {settings['keep']} kept: {', '.join(self.quantities)}",
        ]
        for direction in self.directions:
            runs = self.runs(direction)
            shown = list(range(len(runs)))
            if len(runs) > _LISTED:
                shown = [*shown[: _LISTED // 2], *shown[-_LISTED // 2 :]]
            for position, i in enumerate(shown):
                if position and i > shown[position - 1] + 1:
                    lines.append(f"  ... {i - shown[position - 1] - 1} more ...")
                label, low, high, many = runs[i]
                place = f"{low:.6g}" if many == 1 else f"{low:.6g} to {high:.6g}"
                lines.append(f"  {direction:7s} {place:24s} {label or 'not computed'}")
        if any(self.reasons.ravel()):
            i, k = np.argwhere(self.reasons != "")[0]
            lines.append(f"  at {self.values[k]:.6g}: {self.reasons[i, k]}")
        return "\n".join([*lines, f"  {self.stopped}"])

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset, with the dimensions direction, value, kept, quantity, exponent and others."""
        from saltus.extras import xr

        each = ("direction", "value")
        unit = f"per {self.system.time_unit}"
        named = json.dumps(dict(enumerate(self.system.mode_names)))
        data: dict[str, Any] = {
            "points": ((*each, "kept", "quantity"), np.array(self.points)),
            "label": (each, self.labels.astype(object)),
            "period": (each, np.array(self.periods), {"units": "returns"}),
            "rotation": (each, np.array(self.rotations), {"units": "turns per return"}),
            "curves": (each, np.array(self.curves)),
            "lyapunov": ((*each, "exponent"), np.array(self.exponents), {"units": unit}),
            "lyapunov_error": ((*each, "exponent"), np.array(self.errors), {"units": unit}),
            "return_time": (each, np.array(self.return_times)),
            "observed": ((*each, "observable"), np.array(self.observed)),
            "reason": (each, self.reasons.astype(object)),
            "end_state": ((*each, "state"), np.array(self.states)),
            "end_mode": (each, np.array(self.modes), {"meaning": named}),
        }
        coords = {
            "direction": list(self.directions),
            "value": ("value", np.array(self.values), {"parameter": self.parameter}),
            "quantity": list(self.quantities),
            "observable": np.array(self.observables, dtype=object),
            "state": list(self.system.all_states),
        }
        attrs = {
            "parameter": self.parameter,
            "definition": json.dumps(self.system.definition()),
            "parameters": json.dumps(dict(self.parameters)),
            "settings": json.dumps(dict(self.settings)),
            **{f"criteria_{name}": value for name, value in self.settings["criteria"].items()},
            "stopped": self.stopped,
        }
        return xr.Dataset(data, coords=coords, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> Sweep:
        each = ("direction", "value")
        system = held_any(held)
        held.names("state", system.all_states)
        values = checks.ascending("variable 'value'", held.array("value", ("value",)))
        directions = tuple(held.array("direction", ("direction",), str).tolist())
        if directions not in (("up",), ("down",), ("up", "down"), ("restart",)):
            raise InputError("variable 'direction'", directions, "up, down, both of them, or restart")
        states = held.array("end_state", (*each, "state"), finite=False)
        modes = held.array("end_mode", each, int, least=-1, most=len(system.modes) - 1)
        if not np.isfinite(states[modes >= 0]).all():
            raise InputError("variable 'end_state'", math.nan, "finite where a motion ended")
        return cls(
            system,
            swept_parameter(held, system),
            values,
            held_parameters(held, system),
            directions,
            tuple(held.array("quantity", ("quantity",), str).tolist()),
            held.array("points", (*each, "kept", "quantity"), finite=False),
            held.array("label", each, str),
            held.array("period", each, int, least=0),
            held.array("rotation", each, finite=False),
            held.array("curves", each, int, least=0),
            held.array("lyapunov", (*each, "exponent"), finite=False),
            held.array("lyapunov_error", (*each, "exponent"), finite=False),
            held.array("return_time", each, finite=False),
            tuple(held.array("observable", ("observable",), str).tolist()),
            held.array("observed", (*each, "observable"), finite=False),
            held.array("reason", each, str),
            states,
            modes,
            _checked_settings(held.json("settings", dict)),
            held.text("stopped"),
        )


def _checked_settings(settings: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of a file; raise `InputError` where one that is asked for is missing or another thing."""
    kinds = {"discard": int, "keep": int, "criteria": dict, "section": (str, dict, type(None))}
    for name, kind in kinds.items():
        if name not in settings or not isinstance(settings[name], kind):  # type: ignore[arg-type]
            raise InputError(f"setting {name!r}", settings.get(name), "as run_sweep writes it")
    section = settings["section"]
    if isinstance(section, dict) and not isinstance(section.get("event"), str):
        raise InputError("setting 'section'", section, "one with an event")
    return settings


def _told(section: object) -> str:
    """The section in words."""
    if isinstance(section, Mapping):
        return f"{section['event']} = 0"
    return str(section)
