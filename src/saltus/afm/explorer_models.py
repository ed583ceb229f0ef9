"""Tapping mode in the explorer: the paper's models, the parameter sets, readings and films of their orbits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus.afm.files.configuration import named_experiment
from saltus.afm.files.sets import entries_of, names
from saltus.afm.models.orbit_observables import observables
from saltus.afm.paper.table1 import table1
from saltus.afm.paper.tapping import tapping_mode
from saltus.afm.pictures.animation import animate
from saltus.explorer.application import Application
from saltus.explorer.subjects import Subject, definition_of

if TYPE_CHECKING:
    from saltus.orbits import PeriodicOrbit
    from saltus.progress import Report
    from saltus.system import HybridSystem

__all__ = ["TAPPING"]

_MODES = {"tapping-mode-1": 1, "tapping-mode-2": 2}  # modes of the paper's models
_FILMED = ({"z1_nm", "D_nm"}, {"q1", "v1", "z", "force"})  # states and outputs by which systems that tap are known
_READ = "deflection_nm"  # output by which models that have an instrument are known
_WIDTH = 640  # of a film, in pixels


def _titles() -> dict[str, str]:
    found = {key: f"Tapping mode as in the paper, {modes} mode{'s' * (modes > 1)}" for key, modes in _MODES.items()}
    return found | {name: str(entries_of(name).get("title", name)) for name in names()}


def _make(key: str) -> Subject:
    return _of_paper(key, _MODES[key]) if key in _MODES else _of_set(key)


def _of_paper(key: str, modes: int) -> Subject:
    lines = ("import saltus", "from saltus import afm", "", f"system = afm.tapping_mode(afm.table1(), modes={modes})")
    x0 = (-0.67, *[0.0] * (modes - 1), 0.75, *[0.0] * (modes - 1))
    ranges = {"Omega": (0.8, 1.4), "ybar": (0.02, 0.3)}
    return Subject(key, definition_of(tapping_mode(table1(), modes=modes)), lines, x0, ranges)


def _of_set(key: str) -> Subject:
    lines = (
        "import saltus",
        "from saltus.afm.files.configuration import named_experiment",
        "",
        f"system = named_experiment({key!r}).model()",
    )
    experiment = named_experiment(key)
    along, ends = experiment.curve.get("along", ""), experiment.curve.get("range", ())
    ranges = {along: (float(ends[0]), float(ends[1]))} if len(ends) == 2 else {}
    return Subject(key, definition_of(experiment.model()), lines, (), ranges)


def _readings(orbit: PeriodicOrbit) -> Mapping[str, Any]:
    return observables(orbit) if _READ in orbit.system.output_names else {}


def _films(system: HybridSystem) -> bool:
    return any(sign <= {*system.states, *system.output_names} for sign in _FILMED)


def _film(orbit: PeriodicOrbit, path: str, progress: Report | bool) -> Path:
    """Film an orbit; one of the paper's models has the paper's cantilever."""
    setup = None if _READ in orbit.system.output_names else table1()
    return animate(orbit, path, setup=setup, width=_WIDTH, progress=progress)


TAPPING = Application(_titles(), _make, _readings, _films, _film)  # what `saltus explore` offers
