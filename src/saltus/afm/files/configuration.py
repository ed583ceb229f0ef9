"""Configuration files of `saltus afm`, in TOML: probe, laws of force, drives, a place, a curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.afm.curves.curves import distance_curve, frequency_curve
from saltus.afm.curves.identification import fit
from saltus.afm.files.measured_curves import read_curve, read_force_table
from saltus.afm.files.sets import entries_of
from saltus.afm.laws.known import LAWS
from saltus.afm.laws.law import Law, Tabulated
from saltus.afm.models.modelling import model
from saltus.afm.models.readings import CONVENTIONS, lag_of
from saltus.afm.probe.drive import Drive, Drives
from saltus.afm.probe.probe import Probe
from saltus.config_files import attribute_of, called, read_toml
from saltus.continuation import StepControl
from saltus.errors import InputError, nearest
from saltus.fitting import FitOptions

if TYPE_CHECKING:
    import pandas as pd

    from saltus.afm.curves.curve import Curve
    from saltus.fitting import Fit
    from saltus.progress import Report
    from saltus.system import HybridSystem

__all__ = ["Experiment", "model_of", "named_experiment", "read_experiment"]

_TYPES = "the name of a law of saltus.afm, as DMT; Tabulated, with a file; or module:Class"
_ALONG = ("Zc_nm", "f_kHz")  # parameters along which there are curves
_BELOW = 0.9  # how far below a place its curve goes, over the distance
_LEAST_BELOW_NM = 1.0  # how far below a place its curve goes, at least, in nm
_LEAST_ABOVE_NM = 20.0  # how far above a place its curve goes, at least, in nm


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A probe over a sample, as a configuration describes it."""

    probe: Probe  # the cantilever with its tip
    law: Law  # the force between tip and sample
    drive: Drive | Drives  # what keeps the cantilever swinging
    Zc_nm: float | None = None  # gap at rest, if it is given
    f_kHz: float | str = "f0"  # frequency, as `saltus.afm.model` takes it
    check: bool = True  # whether an implausible place is refused
    curve: Mapping[str, Any] = field(default_factory=dict)  # the table ``[curve]``; empty if there is none
    fit: Mapping[str, Any] = field(default_factory=dict)  # the table ``[fit]``; empty if there is none
    # title, source: what is described, and where its values come from
    title: str = ""
    source: str = ""

    def model(self, Zc_nm: float | None = None) -> HybridSystem:
        """Return the hybrid system.

        Parameters
        ----------
        Zc_nm : float, optional
            Gap at rest, where the configuration has none.

        Raises
        ------
        InputError
            No gap is given, or as `saltus.afm.model` does.
        """
        gap = Zc_nm if self.Zc_nm is None else self.Zc_nm
        if gap is None:
            raise InputError("Zc_nm", None, "given", "in the file, above its first table")
        return model(self.probe, self.law, self.drive, Zc_nm=gap, f_kHz=self.f_kHz, check=self.check)

    def traced(self, progress: bool | Report = False) -> Curve:
        """Return the curve that the table ``[curve]`` asks for.

        Parameters
        ----------
        progress : bool or callable, optional
            As `saltus.afm.distance_curve` takes it.

        Raises
        ------
        InputError
            There is no table ``[curve]``, or an entry cannot be used; the error names it.
        """
        if not self.curve:
            raise InputError("curve", None, "given: a table with the range, as range = [0.5, 14.0]")
        found: Curve = called(partial(_curve, self, progress), self.curve, "curve")
        return found

    def around(self, at: float | None = None, progress: bool | Report = False) -> tuple[Curve, float]:
        """Return a curve through a place, and the place.

        The table ``[curve]`` says along what. Without it, the curve is a distance curve, far above and below the place.

        Parameters
        ----------
        at : float, optional
            Distance in nm or frequency in kHz; by default that of the model.
        progress : bool or callable, optional
            As `saltus.afm.distance_curve` takes it.

        Returns
        -------
        Curve
            The curve.
        float
            The place on it.

        Raises
        ------
        InputError
            As `traced` does; or neither a place nor ``Zc_nm`` is given.
        """
        if self.curve:
            curve = self.traced(progress)
            return curve, curve.system.parameters[curve.along] if at is None else at
        place = self.model(at).parameters["Zc_nm"] if at is None else at
        low = place - max(_BELOW * abs(place), _LEAST_BELOW_NM)
        high = place + max(abs(place), _LEAST_ABOVE_NM)
        return distance_curve(self.model(place), (low, high), progress=progress), place

    def fitted(self, data: Path, progress: bool | Report = False) -> Fit:
        """Return the fit to a measured curve that the table ``[fit]`` asks for.

        Parameters
        ----------
        data : Path
            A file that `saltus.afm.read_curve` reads.
        progress : bool or callable, optional
            As `saltus.afm.fit` takes it.

        Raises
        ------
        InputError
            There is no table ``[fit]``, or an entry cannot be used; as `saltus.afm.read_curve` and `saltus.afm.fit` do.
        """
        if not self.fit:
            raise InputError(
                "fit", None, "given: a table with vary = {H_aJ = [0.01, 1.0]}, sigma = {amplitude_nm = 0.03}"
            )
        found: Fit = called(partial(_fit, self, data, progress), self.fit, "fit")
        return found


def read_experiment(path: Path) -> Experiment:
    r"""Return what a TOML file describes.

    Parameters
    ----------
    path : Path
        The file. ``[probe]``, ``[[law]]`` and ``[drive]`` are needed. A law's ``type`` is the name of a class of
        `saltus.afm`, or ``module:Class`` with a module beside the file; reading the file then runs this module.
        ``Tabulated`` takes the path of a CSV file as ``file``, with the columns ``D_nm`` and ``F_nN``.

    Raises
    ------
    InputError
        There is no such file, it is no TOML, or an entry is unknown, missing or of another kind; the error names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "lever.toml"
    ...     _ = path.write_text('''
    ... probe = {k_N_m = 26.0, f0_kHz = 300.0, Q = 400.0, R_nm = 12.0}
    ... law = [{type = "VanDerWaals", H_aJ = 0.12, a0_nm = 0.3}, {type = "DMT", E_GPa = 1.5}]
    ... drive = {A0_nm = 12.0}
    ... ''')
    ...     list(read_experiment(path).law.regions)
    ['far', 'contact']
    """
    entries = read_toml(checks.path("config", path))
    found: Experiment = called(partial(_experiment, path.absolute().parent), entries, "")
    return found


def named_experiment(name: str) -> Experiment:
    """Return the probe over a sample that a parameter set of `saltus.afm.files.sets.names` describes.

    Examples
    --------
    >>> named_experiment("lever-s").model().states
    ('z1_nm', 'v1_nm_us')
    """
    found: Experiment = called(partial(_experiment, Path()), entries_of(name), "")
    return found


def model_of(
    folder: Path, probe: object, law: object, drive: object, Zc_nm: float, f_kHz: float | str = "f0", check: bool = True
) -> HybridSystem:
    """Return the model that tables describe, as those of `saltus basins` under ``[model]``.

    Parameters
    ----------
    folder : Path
        Folder in which modules of one's own laws are looked for first.
    probe, law, drive : object
        Tables.
    Zc_nm, f_kHz, check : optional
        As `saltus.afm.model` takes them.

    Raises
    ------
    InputError
        As `read_experiment` and `saltus.afm.model` do.

    Examples
    --------
    >>> probe = {"k_N_m": 26.0, "f0_kHz": 300.0, "Q": 400.0, "R_nm": 12.0}
    >>> model_of(Path(), probe, {"type": "Hertz", "E_GPa": 1.0}, {"A0_nm": 12.0}, Zc_nm=8.0).mode_names
    ('far', 'contact')
    """
    return _experiment(folder, probe, law, drive, Zc_nm, f_kHz, check).model()


def _experiment(
    folder: Path,
    probe: object,
    law: object,
    drive: object,
    Zc_nm: float | None = None,
    f_kHz: float | str = "f0",
    check: bool = True,
    curve: object = None,
    title: str = "",
    source: str = "",
    fit: object = None,
) -> Experiment:
    laws = [_law(table, folder) for table in _tables("law", law)]
    drives = [called(Drive, table, "drive") for table in _tables("drive", drive)]
    return Experiment(
        probe=called(Probe, _table("probe", probe), "probe"),
        law=reduce(add, laws),
        drive=reduce(add, drives),
        Zc_nm=None if Zc_nm is None else checks.number("Zc_nm", Zc_nm, unit="nm"),
        f_kHz=f_kHz,
        check=checks.flag("check", check),
        curve={} if curve is None else _table("curve", curve),
        fit={} if fit is None else _table("fit", fit),
        title=checks.text("title", title),
        source=checks.text("source", source),
    )


def _table(name: str, value: object) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(name, value, f"a table, [{name}]")
    return dict(value)


def _tables(name: str, value: object) -> list[dict[str, Any]]:
    """Return one table, or several of one name."""
    if isinstance(value, Sequence) and not isinstance(value, str) and value:
        return [_table(name, one) for one in value]
    return [_table(name, value)]


def _law(table: dict[str, Any], folder: Path) -> Law:
    types: dict[str, Any] = {**LAWS, Tabulated.__name__: partial(_tabulated, folder)}
    if "type" not in table:
        raise InputError("law.type", None, f"given: {_TYPES}")
    kind = checks.text("law.type", table.pop("type"))
    make = types.get(kind)
    if make is None:
        if ":" not in kind:
            raise InputError("law.type", kind, _TYPES, nearest(kind, types))
        make = attribute_of(kind, folder, "law.type")
        if not (isinstance(make, type) and issubclass(make, Law)):
            raise InputError("law.type", kind, "a class that is made from saltus.afm.Law", f"it is {make!r}")
    law: Law = called(make, table, "law")
    return law


def _tabulated(folder: Path, file: object) -> Law:
    """Return the law of a table in a file, whose path counts from the folder."""
    return Law.tabulated(**read_force_table(folder / checks.path("file", file)))


def _curve(
    experiment: Experiment,
    progress: bool | Report,
    range: object,
    along: str = "Zc_nm",
    parameters: Mapping[str, float] | None = None,
    of: str | int = "deflection",
    phase_convention: str = "lag90",
    steps: object = None,
    starts: int = 0,
) -> Curve:
    checks.chosen("curve.along", along, _ALONG)
    low, high = checks.interval("curve.range", range, finite=True)
    control = None if steps is None else called(StepControl, _table("curve.steps", steps), "curve.steps")
    make = distance_curve if along == "Zc_nm" else frequency_curve
    system = experiment.model(high if along == "Zc_nm" else None)
    checks.chosen("phase_convention", phase_convention, CONVENTIONS)
    found = make(system, (low, high), parameters=parameters, of=of, steps=control, starts=starts, progress=progress)
    return found.shown_as(phase_convention)


def _fit(
    experiment: Experiment,
    data: Path,
    progress: bool | Report,
    vary: object,
    sigma: object,
    jumps: bool = True,
    start: object = None,
    profile: Sequence[str] | None = None,
    columns: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    phase_convention: str = "lag90",
    signs: Mapping[str, float] | None = None,
    reach: float | None = None,
    max_evaluations: int = FitOptions.max_evaluations,
    priors: object = None,
) -> Fit:
    table = _told(read_curve(data, columns, scale=scale), phase_convention, signs)
    gap = float(table["Zc_nm"].max()) if "Zc_nm" in table else None
    bounds = {
        name: checks.interval(f"fit.vary.{name}", limits, finite=True)
        for name, limits in _table("fit.vary", vary).items()
    }
    options = FitOptions(
        start={} if start is None else _table("fit.start", start),
        profile=profile,
        reach=reach,
        max_evaluations=max_evaluations,
    )
    errors = _table("fit.sigma", sigma)
    held = None if priors is None else _table("fit.priors", priors)
    return fit(
        table, experiment.model(gap), bounds, errors, jumps=checks.flag("fit.jumps", jumps), priors=held,
        options=options, progress=progress,
    )  # fmt: skip


def _told(table: pd.DataFrame, phase_convention: object, signs: object) -> pd.DataFrame:
    """Return a measured curve with columns of other signs turned, and phases of a convention as lags."""
    table = table.copy()
    for name, sign in ({} if signs is None else _table("fit.signs", signs)).items():
        checks.chosen("fit.signs", name, [one for one in table.columns if one != "direction"])
        if sign not in (1, -1):
            raise InputError(f"fit.signs.{name}", sign, "1 or -1")
        table[name] *= sign
    if checks.chosen("phase_convention", phase_convention, CONVENTIONS) != "lag90":
        for name in table.columns:
            if name.startswith("lag_deg"):
                table[name] = lag_of(table[name], str(phase_convention))
    return table
