"""A curve of an instrument: amplitude, lag and other readings along distance or frequency, with all sheets."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.curves.features import WORDS, Feature, Jump
from saltus.afm.curves.routes import Landing, Way, ways_of
from saltus.afm.models.parts import check_model, values_of
from saltus.afm.models.readings import CONVENTIONS, formulas, readings_of, regime, shown_phase, turns_of
from saltus.contents import Contents
from saltus.continuation import Branch
from saltus.continuation.results.branch_files import RAGGED, branches_of, branches_together
from saltus.continuation.results.crossings import comes_to, covered
from saltus.described import described
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.result import Result
from saltus.system.plain import held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["Curve", "Feature", "Jump"]

_DIRECTIONS = {"Zc_nm": ("approach", "retract"), "f_kHz": ("down", "up")}  # of the ways to lower and higher values
_NONE = np.empty(0)
_BESIDE = 0.125  # distance of a failure, over the range, that is next to a place
_ALWAYS = 1.0 - 1e-9  # share of the time in contact of a tip that never leaves it, less rounding


@dataclass(frozen=True, eq=False, repr=False)
class Curve(Result):
    """Readings along distance or frequency: stable and unstable orbits, jumps, the ways that an experiment takes.

    `saltus.afm.distance_curve` and `saltus.afm.frequency_curve` make it.

    Attributes
    ----------
    system : HybridSystem
        The model.
    along : str
        What varies: ``Zc_nm``, ``f_kHz`` or another parameter.
    bounds : (float, float)
        Its range.
    branches : tuple of Branch
        The sheets: branches of periodic orbits that no fold joins.
    of : str or int
        Of what amplitude and lag are told: ``deflection``, ``tip``, or the number of a mode.
    phase_convention : str
        What is shown of the lag, as `saltus.afm.observables` takes it: ``lag90``, ``bruker0`` or ``asylum``.
    failures : tuple of (float, str)
        Places where motions from some start settle on no orbit that is followed, and what they do instead.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=20.0)
    >>> curve = afm.distance_curve(system, (9.0, 14.0))
    >>> [(jump.direction, round(jump.value, 3)) for jump in curve.jumps]
    [('approach', 9.878), ('retract', 11.503)]
    """

    system: HybridSystem
    along: str
    bounds: tuple[float, float]
    branches: tuple[Branch, ...]
    of: str | int = "deflection"
    phase_convention: str = "lag90"
    failures: tuple[tuple[float, str], ...] = ()

    def __len__(self) -> int:
        return sum(len(branch) for branch in self.branches)

    @property
    def directions(self) -> tuple[str, str]:
        """Names of the ways to lower and to higher values."""
        return _DIRECTIONS.get(self.along, ("down", "up"))

    @cached_property
    def _formulas(self) -> dict[str, str]:
        return formulas(self.system, self.of, self.phase_convention)

    @property
    def readings(self) -> tuple[str, ...]:
        """Names of the readings."""
        return tuple(self._formulas)

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a reading, or a quantity of the orbits, at all points, sheet after sheet.

        Parameters
        ----------
        name : str
            A reading, as ``amplitude_nm``; or what `Branch.column` takes, as ``"amplitude(deflection_nm, 2)"``.

        Returns
        -------
        ndarray, shape (point,)

        Raises
        ------
        InputError
            There is no such reading or quantity.

        Examples
        --------
        >>> from saltus import afm
        >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0)
        >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
        >>> curve = afm.distance_curve(system, (5.0, 15.0))
        >>> float(curve.column("amplitude_nm").max().round(6))
        10.0
        """
        text = self._formulas.get(checks.text("name", name, "the name of a reading"), name)
        if "(" not in text:
            known = [*self._formulas, *self.branches[0].quantities, self.along, "period"]
            checks.chosen("reading", text, known, instead=", or an observable")
        return np.concatenate([branch.column(self.formula(name)) for branch in self.branches])

    def formula(self, name: str) -> str:
        """Return a reading as a formula in observables, as `Branch.column` takes it; other names as they are.

        A lag runs on continuously along a sheet; it begins between 0 and 360 degrees on the first one.

        Parameters
        ----------
        name : str
            A reading, or a quantity that `Branch.column` takes.

        Returns
        -------
        str

        Raises
        ------
        InputError
            `name` is no text.

        Examples
        --------
        >>> from saltus import afm
        >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0)
        >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
        >>> afm.distance_curve(system, (5.0, 15.0)).formula("peak_force_nN")
        'max(force_nN)'
        """
        checks.text("name", name, "the name of a reading")
        text = self._formulas.get(name, name)
        if name.startswith("shown_phase_deg"):
            return shown_phase(self.formula(name.replace("shown_phase", "lag")), self.phase_convention)
        if name.startswith("lag_deg") and (turns := self._turns(text)):
            return f"{text} - {360 * turns}"
        return text

    def shown_as(self, phase_convention: str) -> Curve:
        """Return the same curve with phases as an instrument shows them: the reading ``shown_phase_deg``.

        Parameters
        ----------
        phase_convention : {"lag90", "bruker0", "asylum"}
            What is shown of the lag, as `saltus.afm.observables` takes it.

        Returns
        -------
        Curve

        Raises
        ------
        InputError
            There is no such convention.

        Examples
        --------
        >>> from saltus import afm
        >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0)
        >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
        >>> curve = afm.distance_curve(system, (5.0, 15.0)).shown_as("bruker0")
        >>> bool(curve.column("shown_phase_deg").max() > 50.0)  # the sample repels
        True
        """
        checks.chosen("phase_convention", phase_convention, CONVENTIONS)
        shown = replace(self, phase_convention=phase_convention)
        if "ways" in vars(self):  # they are those of the same orbits
            vars(shown)["ways"] = self.ways
        return shown

    def harmonic_nm(self, order: int) -> NDArray[np.float64]:
        """Return the amplitude of the deflection at a multiple of the first drive's frequency, at all points.

        Parameters
        ----------
        order : int
            Which multiple.

        Returns
        -------
        ndarray, shape (point,), in nm

        Raises
        ------
        InputError
            `order` is below 1.

        Examples
        --------
        >>> from saltus import afm
        >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0)
        >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
        >>> curve = afm.distance_curve(system, (5.0, 15.0))
        >>> f"{curve.harmonic_nm(6).max():.4f} nm"
        '0.0011 nm'
        """
        return self.column(f"amplitude(deflection_nm, {checks.count('order', order) * turns_of(self.system)})")

    def _turns(self, text: str) -> int:
        values = self.branches[0].column(text)
        known = values[np.isfinite(values)]
        return int(known[0] // 360.0) if known.size else 0

    @property
    def special_points(self) -> tuple[Feature, ...]:
        """Special points of all sheets in an instrument's words."""
        found = []
        for sheet, branch in enumerate(self.branches):
            for point in branch.special_points:
                amplitude = branch.value_at(point, self.formula("amplitude_nm"))
                what = WORDS.get(point.type, point.type)
                found.append(Feature(point.label, what, point.value(self.along), amplitude, sheet, point.orbit))
        return tuple(found)

    def at(self, value: float | None = None, **place: float) -> tuple[PeriodicOrbit, ...]:
        """Return the orbits of all sheets at a distance or frequency.

        Parameters
        ----------
        value : float, optional
            The distance or frequency; it may be given by its name, as ``Zc_nm=8.5``.
        **place : float
            The same by name.

        Returns
        -------
        tuple of PeriodicOrbit
            Sheet after sheet, in order along each.

        Raises
        ------
        InputError
            No sheet comes there, or the value is no number, or given twice or by another name.

        Warns
        -----
        RuntimeWarning
            Motions may be missing: one of `failures` is within an eighth of the range.
        """
        if (value is None) == (not place) or (place and set(place) != {self.along}):
            raise InputError("at", place or value, f"one value of {self.along}, as {self.along}={self.values[0]:.6g}")
        wanted = checks.number(self.along, place[self.along] if value is None else value)
        reached = [branch for branch in self.branches if comes_to(branch, wanted)]
        if not reached:
            parts = " or ".join(f"between {low:.9g} and {high:.9g}" for low, high in covered(self.branches))
            raise InputError(self.along, wanted, f"{parts}, where the curve is")
        beside = _BESIDE * (self.bounds[1] - self.bounds[0])
        if doubts := [text for place, text in self.failures if abs(place - wanted) <= beside]:
            others = f", and {len(doubts) - 1} more" * (len(doubts) > 1)
            told = f"saltus: motions may be missing at {self.along} = {wanted:.9g}: {doubts[0]}{others}"
            warnings.warn(told, RuntimeWarning, stacklevel=2)
        return tuple(orbit for branch in reached for orbit in branch.at(wanted))

    @property
    def values(self) -> NDArray[np.float64]:
        """The distance or frequency of all points, sheet after sheet."""
        return np.concatenate([branch.values for branch in self.branches])

    @cached_property
    def ways(self) -> tuple[Way, Way]:
        """The ways that an experiment takes to lower and to higher values."""
        return ways_of(self.branches, self.bounds)

    @property
    def jumps(self) -> tuple[Jump, ...]:
        """Jumps on the ways in and out: where, from which amplitude, to which.

        A way that goes on behind a window of other motions does not jump there; `path` has the window.
        """
        return tuple(
            Jump.of(name, self.along, jump, self._formulas["amplitude_nm"])
            for way, name in zip(self.ways, self.directions, strict=True)
            for jump in way.jumps
            if not jump.window
        )

    @described
    def path(self, direction: str) -> xr.Dataset:
        """Return the readings on the way that an experiment takes.

        A sheet is followed while it is stable. Where it ends, the motion goes to another stable sheet: the one on which
        a motion settles that starts just beyond.

        Parameters
        ----------
        direction : {"approach", "retract"} or {"up", "down"}
            The way, along distance or along frequency.

        Returns
        -------
        xarray.Dataset
            Along ``point``, in the order of the experiment: the varied parameter, the readings and ``sheet``. ``jump``
            is True at the first point behind a jump or a window. The attribute ``stopped`` says why the way ends,
            ``windows`` where other motions lie between two sheets, as JSON: begin, end, what the motion does.

        Raises
        ------
        InputError
            There is no such direction.
        """
        from saltus.extras import xr

        way = self.ways[self.directions.index(checks.chosen("direction", direction, self.directions))]
        starts = np.cumsum([0, *(len(branch) for branch in self.branches)])
        parts = np.split(np.array(way.points, dtype=np.int64).reshape(-1, 2), way.first_behind)
        table = {self.along: self.values} | {name: self.column(name) for name in self._formulas}
        columns: dict[str, list[NDArray[np.float64]]] = {name: [] for name in (*table, "sheet", "jump")}
        for k, part in enumerate(parts):
            rows = starts[part[:, 0]] + part[:, 1]
            before = self._reading_at(way.jumps[k], table, rows[-1:]) if k < len(way.jumps) else {}
            after = self._reading_at(way.jumps[k - 1], table, rows[:1], landed=True) if k else {}
            for name, values in table.items():
                columns[name] += [after.get(name, _NONE), values[rows], before.get(name, _NONE)]
            ends = int(bool(after)), int(bool(before))
            columns["sheet"].append(np.pad(part[:, 0], ends, "edge" if len(part) else "constant"))
            columns["jump"].append(np.arange(len(rows) + sum(ends)) == (0 if after else -1))
        found = {name: np.concatenate(values) for name, values in columns.items()}
        data: dict[str, Any] = {name: ("point", found[name], self._attributes(name)) for name in self._formulas}
        data |= {"sheet": ("point", found["sheet"].astype(np.int64)), "jump": ("point", found["jump"].astype(bool))}
        coords = {self.along: ("point", found[self.along], self._attributes(self.along))}
        attrs = {"direction": direction, "stopped": way.stopped, "phase_convention": self.phase_convention}
        if way.windows:
            attrs["windows"] = json.dumps(way.windows)
        return xr.Dataset(data, coords, attrs)

    def _reading_at(
        self, jump: Landing, table: Mapping[str, NDArray[np.float64]], row: NDArray[np.int64], *, landed: bool = False
    ) -> dict[str, NDArray[np.float64]]:
        """Return the readings before a jump, or where it has landed, shape (1,) each; `row`: the point next to it."""
        orbit = jump.after if landed else jump.before
        texts = {name: self.formula(name) for name in self._formulas}
        seen = orbit.observe(*texts.values())
        found = {name: np.array([seen[text]]) for name, text in texts.items()}
        for name in found:
            if name.startswith(("lag_deg", "shown_phase_deg")):
                found[name] += 360.0 * np.round((table[name][row] - found[name]) / 360.0)
        return found | {self.along: np.array([orbit.parameters[self.along]])}

    @described
    def to_xarray(self, *, harmonics: Sequence[int] = ()) -> xr.Dataset:
        """Return the curve as a Dataset: readings and orbits along ``point``, sheet after sheet.

        Parameters
        ----------
        harmonics : sequence of int, optional
            Multiples of the first drive's frequency at which ``harmonic_nm`` has the amplitudes of the deflection.

        Returns
        -------
        xarray.Dataset
            ``regime`` has the regimes by the sign of the virial. The attributes ``probe``, ``law`` and ``drive`` have
            what the model is made of, as JSON.

        Raises
        ------
        InputError
            A harmonic is below 1.
        """
        from saltus.extras import xr

        data, coords = branches_together(self.branches, "sheet")
        data |= {name: ("point", self.column(name), self._attributes(name)) for name in (self.along, *self._formulas)}
        if orders := checks.listed("harmonics", harmonics, "orders of harmonics, as (2, 6)"):
            rows = np.array([self.harmonic_nm(order) for order in orders])
            data["harmonic_nm"] = (("harmonic", "point"), rows, self._attributes("harmonic_nm"))
            coords["harmonic"] = ("harmonic", np.array(orders))
        data["regime"] = ("point", [regime(virial) for virial in self.column("virial_eV")], {"long_name": "regime"})
        held = {name: value for name, value in self.branches[0].parameters.items() if name != self.along}
        attrs = {name: json.dumps(part) for name, part in values_of(self.system, held).items()} | {
            "along": self.along, "low": self.bounds[0], "high": self.bounds[1], "of": json.dumps(self.of),
            "definition": json.dumps(self.system.definition()), "phase_convention": self.phase_convention,
            "ragged": RAGGED, "failures": json.dumps(self.failures),
        }  # fmt: skip
        return xr.Dataset(data, coords=coords, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> Curve:
        system, along = held_system(held), held.text("along")
        check_model(system, "definition")
        checks.chosen("attribute 'along'", along, system.parameter_names)
        count = held.size("sheet", least=1)
        found = branches_of(held, "sheet", [False] * count, along)
        of = held.json("of", str) if held.text("of").startswith('"') else held.json("of", int)
        branches = tuple(branch for branch in found if branch is not None)
        low, high = held.number("low"), held.number("high")
        convention = checks.chosen("attribute 'phase_convention'", held.text("phase_convention"), CONVENTIONS)
        told = held.json("failures", list) if "failures" in held.dataset.attrs else []
        failures = tuple((checks.number("failures", place), checks.text("failures", text)) for place, text in told)
        return cls(system, along, (low, high), branches, of, convention, failures)

    def __repr__(self) -> str:
        low, high = float(self.values.min()), float(self.values.max())
        amplitude = self.column("amplitude_nm")
        lines = [
            f"Curve of {self.system.name or 'a model'}: {self.along} from {low:.6g} to {high:.6g}, {len(self)} orbits",
            f"  amplitude   {amplitude.min():.6g} to {amplitude.max():.6g} nm",
        ]
        points = self.special_points
        sheets = [f" ({f.sheet})" if sum(g.label == f.label for g in points) > 1 else "" for f in points]
        lines += [
            f"  {f.label + sheet:10}  {self.along} = {f.value:.9g}, {f.amplitude_nm:.6g} nm: {f.what}"
            + f", on sheet {f.sheet}" * bool(sheet)
            for f, sheet in zip(points, sheets, strict=True)
        ]
        if "contact_fraction" in self.readings and self.column("contact_fraction").min() > _ALWAYS:
            lines.append("  contact     at all times: the tip is pulled in at larger distances already")
        for way, name in zip(self.ways, self.directions, strict=True):
            lines += [f"  {name:10}  {one.begin:.9g} to {one.end:.9g}: {one.words}" for one in way.windows]
            lines.append(f"  {name:10}  {way.stopped}")
        lines += [f"  in part     {failure}" for failure in dict.fromkeys(text for _, text in self.failures)]
        return "\n".join(lines)

    def _attributes(self, name: str) -> dict[str, str]:
        reading = readings_of(name, self.phase_convention)
        return {"units": reading.unit, "long_name": reading.long_name}
