"""Results in files, mutated at random: what `load` returns can be used, and everything else is told in a line."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray as xr

import fields
import systems
from discrete import tent_of
from saltus import (
    Average,
    HybridSystem,
    Mode,
    Transition,
    continue_equilibrium,
    continue_family,
    continue_locus,
    continue_orbit,
    find_attractors,
    find_equilibrium,
    find_orbit,
    fit,
    follow_cascade,
    iterate,
    load,
    lyapunov_spectrum,
    map_basins,
    run_sweep,
    simulate,
    solve_orbit,
    verify,
)
from saltus.basins.attractors.attractors import Attractors
from saltus.basins.attractors.found import AttractorOptions
from saltus.basins.map.basins import Basins
from saltus.basins.map.grid import Grid
from saltus.basins.map.labelling import Labelling
from saltus.basins.measures.erosion import ErosionProfile
from saltus.ensemble.traps import Cages, Cells, Ellipsoids, Traps
from saltus.errors import SaltusError
from saltus.files import write_sealed
from saltus.options import SweepOptions
from saltus.result import Result, netcdf, tagged

JUNK: tuple[Any, ...] = (
    None, True, -1, 0, 1, 7, 10**12, -(10**12), 10**30, 0.5, 1e308, float("nan"), float("inf"), "", "x", "<b>", "0",
    "\0", "x" * 5000, [], {}, [1], ["x"], {"x": 1}, {"": []}, [[]], [None],
)  # fmt: skip
"""What is put in the place of a part of a JSON attribute."""


def logistic() -> HybridSystem:
    return HybridSystem(
        ("x", "s"),
        {"r": 2.8, "q": 1.0},
        {"carry": Mode({"x": "0", "s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, {"x": "r*q*x*(1 - x)", "s": "0"}, name="map")],
        name="logistic map",
    )


def attractors(orbit: Any) -> Attractors:
    """Attractors with every kind of trapping region, none of them measured."""
    n = len(orbit.system.states)
    traps = Traps(
        n,
        Ellipsoids(orbit.x0[None], np.eye(n)[None], np.zeros(1, np.uint8)),
        Cages(orbit.x0[None], np.eye(n)[None] * (1.0 + 1.0j), np.zeros((1, n)), np.ones(1), np.zeros(1, np.int64),
              np.zeros(1, np.uint8)),
        Cells(np.zeros(n), np.ones(n), np.array([[1] * n, [2] * n]), np.ones(2, np.uint8), 16),
    )  # fmt: skip
    return Attractors(
        orbit.system, orbit.parameters, dict.fromkeys(orbit.system.states, (-2.0, 2.0)), None, ("one", "two"),
        {"one": "period-1", "two": "chaotic"}, {"one": orbit.x0[None], "two": np.full((3, n), 1.5)}, {"one": orbit},
        traps, {"one": "by hand", "two": "by hand"}, {"one": 3, "two": 4}, 0.01,
    )  # fmt: skip


def basins(held: Attractors) -> Basins:
    """Basins that are of these attractors, whatever the labels are."""
    grid = Grid(held.system.states, {"x": (-1.0, 1.0, 4), "v": (-1.0, 1.0, 3)})
    inputs = Labelling(held.system, held.parameters, held.traps, None, 1e-9, 200).definition()
    labels = np.array([[0, 1, 254], [1, 1, 0], [0, 0, 0], [253, 1, 255]], dtype=np.uint8)
    return Basins(labels, grid, held, inputs, "interrupted: 11 of 12 cells done")


def samples() -> dict[str, Result]:
    """A result of every kind that can be saved."""
    oscillator, carried = systems.impact_oscillator(), logistic()
    orbit = find_orbit(oscillator, {"d": 0.5}, [0.0, 0.0])
    fixed = solve_orbit(carried, {}, [("carry", "map", [0.64, 0.0], 1.0)])
    branch = continue_orbit(fixed, "r", (2.5, 3.4))
    held = attractors(orbit)
    rests = continue_equilibrium(find_equilibrium(fields.chua(), mode="inner"), "d", (-1.0, 1.0))
    takens = find_equilibrium(fields.system(fields.TAKENS, {"b1": -1.0, "b2": -1.0}), x0=[-1.0, 0.0])
    fold = continue_equilibrium(takens, "b1", (-2.0, 2.0))["SN1"]
    shape = (2, 2, 1)
    profile = ErosionProfile(
        oscillator, "w", np.array([1.0, 1.1]), oscillator.parameters, ("one", "two"), ("GIM",), np.ones(shape),
        np.zeros(shape), np.zeros(shape, bool), np.full(shape, "by hand"), basins(held).grid.definition(), "done",
    )  # fmt: skip
    swept = SweepOptions(section="map", quantities=["x"], observables=["mean(x)"], discard=50, keep=10)
    return {
        "trajectory": simulate(oscillator, {"d": 0.5}, [0.0, 0.0], periods=4),
        "orbit": orbit,
        "branch": branch,
        "fit": _fit(),
        "locus": continue_locus(branch["PD1"], ("r", "q"), {"r": (2.9, 3.1), "q": (0.95, 1.05)}),
        "equilibrium": rests.solution(0),
        "equilibria": rests,
        "folds": continue_locus(fold, ("b1", "b2"), {"b1": (-1.0, 2.0), "b2": (-2.0, 2.0)}),
        "family": continue_family(fixed, "r", {"q": [0.98, 1.0, 5.0]}, (2.5, 3.4), workers=1),
        "cascade": follow_cascade(branch["PD1"], (2.5, 4.0), doublings=2),
        "sweep": run_sweep(carried, "r", [2.9, 3.2, 3.7], x0=[0.3, 0.0], options=swept),
        "spectrum": lyapunov_spectrum(oscillator, {"d": 0.5}, [0.0, 0.0], average=Average(periods=20)),
        "attractors": held,
        "basins": basins(held),
        "array": Basins.from_array([0, 1, 1, 0], {"x": np.arange(4.0)}, {"a": 0, "b": 1}, {"a": [[1.0]]}),
        "profile": profile,
        "point": branch["PD1"],
        "bifurcation": fold,
        "verification": verify(rests.solution(0)),
        **_of_maps(),
    }  # fmt: skip


def _fit() -> Result:
    """A fit to two channels, one of them complex."""
    spring = HybridSystem.smooth(
        {"x": "v", "v": "-c*v - k*x + cos(s)"}, {"k": 1.2, "c": 0.3, "w": 1.0}, phase=("s", "w"), name="spring"
    )
    w = np.linspace(0.6, 1.4, 5)
    harmonic = 1j / (1.0 - w**2 + 0.2j * w)
    data = {"w": w, "harmonic(x, 1)": harmonic, "amplitude(x, 1)": abs(harmonic), "direction": ["up"] * 5}
    start = continue_orbit(find_orbit(spring, {}, [0.0, 0.0]), "w", (0.5, 1.5))
    return fit(data, start, {"k": (0.5, 2.0), "c": (0.05, 1.0)}, {"harmonic(x, 1)": 0.01, "amplitude(x, 1)": 0.01})


def _of_maps() -> dict[str, Result]:
    tent, region = tent_of(), {"x": (-0.2, 1.2)}
    found = find_attractors(tent, {"a": 1.7}, region, options=AttractorOptions(starts=16, samples=100))
    return {
        "iterates": iterate(tent, x0=[0.2], n=6),
        "map sweep": run_sweep(tent, "a", [0.8, 1.7], x0=[0.3], options=SweepOptions(discard=50, keep=10)),
        "map spectrum": lyapunov_spectrum(tent, {}, [0.2], average=Average(periods=20)),
        "map attractors": found,
        "map basins": map_basins(tent, {"a": 1.7}, {"x": (-0.2, 1.2, 12)}, found),
    }


def use(found: Any) -> None:
    """Do with a result what one does with it first."""
    repr(found)
    _USES[type(found).__name__](found)


def _use_trajectory(found: Any) -> None:
    times = np.linspace(0.0, found.t_end, 7)
    found(times), found.mode_at(times), found.output(found.system.states[0], times)
    found.observe(f"max({found.system.states[0]})")


def _use_iterates(found: Any) -> None:
    found.itinerary, found.steps, found.output(found.system.states[0])
    found.observe(f"max({found.system.states[0]})")


def _use_orbit(found: Any) -> None:
    repr((found.stable, found.reasons, found.segments, found.min))
    found.sample(20)
    found.observe(f"mean({found.system.states[0]})")


def _use_curve(found: Any) -> None:
    found.column("period"), found.special_points.to_dataframe()
    for point in found.special_points:
        repr(point), found.value_at(point, "period"), point.sizes
        _use_orbit(point.orbit)
    if len(found):
        _use_orbit(found.solution(len(found) // 2))
        found.signature(0)


def _use_equilibrium(found: Any) -> None:
    repr((found.stable, found.kind, found.regular, found[found.system.states[0]]))
    found.problem()


def _use_equilibria(found: Any) -> None:
    for name in (*found.varied, *found.system.states, *found.system.output_names, "arclength"):
        found.column(name)
    found.special_points.to_dataframe()
    for point in found.special_points:
        repr(point), found.value_at(point, found.system.states[0]), point.parameters
        _use_equilibrium(point.equilibrium)
    if len(found):
        _use_equilibrium(found.solution(len(found) // 2))


def _use_family(found: Any) -> None:
    for branch in found:
        if branch is not None:
            _use_curve(branch)


def _use_fit(found: Any) -> None:
    repr((found.errors, found.correlation, found.message, found.parameters)), found.to_dataframe()
    found[found.names[0]], found.plot()
    for branch in found.branches:
        _use_curve(branch)


def _use_cascade(found: Any) -> None:
    repr((found.values, found.ratios, found.limit)), found.to_dataframe()
    _use_orbit(found.start.orbit)
    for branch in found.branches:
        _use_curve(branch)


def _use_sweep(found: Any) -> None:
    found.runs(), found.done
    for name in (*found.quantities, *found.observables):
        found.column(name)
    found.at(float(found.values[0]), found.directions[0])


def _use_spectrum(found: Any) -> None:
    repr((found.running, found.sum, found.kaplan_yorke, found.period))


def _use_attractors(found: Any) -> None:
    repr(found.labels)
    for name in found.names:
        found.traps.of(found.points[name][0], 0), found.traps.box_of(found.points[name][0])
    for orbit in found.orbits.values():
        _use_orbit(orbit)


def _use_basins(found: Any) -> None:
    found.fractions(), found.names, found.noted_error
    name, (low, high, _) = found.grid.names[0], found.grid.ranges[0]
    if len(found.grid.names) > 1:
        repr(found.section(**{name: 0.5 * (low + high)}))


def _use_profile(found: Any) -> None:
    for name in found.attractors:
        for measure in found.measures:
            found.of(measure, name)


def _use_point(found: Any) -> None:
    repr((found.multiplicity, found.sizes, found.parameters, found.normal_form))


def _use_verification(found: Any) -> None:
    repr((found.passed, found.failures, found.unchecked)), found.to_dataframe()


_USES: Mapping[str, Callable[[Any], None]] = {
    "SpecialPoint": _use_point, "Verification": _use_verification,
    "Trajectory": _use_trajectory, "Iterates": _use_iterates,
    "PeriodicOrbit": _use_orbit, "Branch": _use_curve, "Locus": _use_curve,
    "Equilibrium": _use_equilibrium, "EquilibriumBranch": _use_equilibria, "EquilibriumLocus": _use_equilibria,
    "Family": _use_family, "Fit": _use_fit, "Cascade": _use_cascade,
    "Sweep": _use_sweep, "LyapunovSpectrum": _use_spectrum, "Attractors": _use_attractors,
    "Basins": _use_basins, "ErosionProfile": _use_profile,
}  # fmt: skip


# mutations


def mutate(result: Result, random: np.random.Generator, path: Path) -> str:
    """Write the file of a result with one thing changed in it, and say what."""
    kind = random.choice(["bytes", "variable", "number", "attribute", "json"], p=[0.1, 0.2, 0.3, 0.15, 0.25])
    if kind == "bytes":
        return _mutate_bytes(bytes(netcdf({"": tagged(result)})), random, path)
    dataset = tagged(result)
    for name in {"labels"} & set(dataset.variables):
        dataset[name].encoding.clear()
    change = {
        "variable": _mutate_variable, "number": _mutate_number, "attribute": _mutate_attribute, "json": _mutate_json,
    }  # fmt: skip
    try:
        dataset, said = change[kind](dataset, random)
        content = netcdf({"": dataset})
    except Exception as error:  # what xarray does not make or write cannot be in a file
        content, said = netcdf({"": tagged(result)}), f"nothing ({type(error).__name__})"
    write_sealed(path, content)
    return f"{kind}: {said}"


def _mutate_bytes(content: bytes, random: np.random.Generator, path: Path) -> str:
    """Change bytes of a file that has no seal, as one has not that another program has written."""
    how, at = random.choice(["flip", "cut", "zeros", "insert"]), int(random.integers(len(content)))
    changed = bytearray(content)
    if how == "flip":
        changed[at] ^= 1 << int(random.integers(8))
    elif how == "cut":
        del changed[at:]
    elif how == "zeros":
        changed[at : at + 64] = bytes(min(64, len(content) - at))
    else:
        changed[at:at] = random.bytes(8)
    path.write_bytes(bytes(changed))
    return f"bytes: {how} at {at}"


def _mutate_variable(dataset: xr.Dataset, random: np.random.Generator) -> tuple[xr.Dataset, str]:
    name = str(random.choice(list(dataset.variables)))
    how = str(random.choice(["drop", "kind", "shorter", "rename", "transpose", "scalar", "text"]))
    variable = dataset[name]
    if how == "drop":
        return dataset.drop_vars(name), f"drop {name}"
    if how == "shorter":
        dim = str(random.choice(list(dataset.sizes)))
        kept = slice(int(random.integers(0, max(dataset.sizes[dim], 1))))
        return dataset.isel({dim: kept}), f"{dim} cut to {kept.stop}"
    if how == "rename":
        dim = str(random.choice(list(dataset.sizes)))
        return dataset.rename_dims({dim: f"{dim}_"}), f"{dim} renamed"
    changed = dataset.drop_vars(name)
    if how == "kind":
        kind = str(random.choice(["float32", "int8", "uint64", "bool", "str"]))
        changed[name] = (variable.dims, _as_kind(variable.values, kind), variable.attrs)
        return changed, f"{name} as {kind}"
    values = {"transpose": variable.values.T, "scalar": 3.0, "text": "text"}[how]
    changed[name] = (variable.dims[::-1], values) if how == "transpose" else ((), values)
    return changed, f"{name} {how}"


def _as_kind(values: np.ndarray, kind: str) -> np.ndarray:
    if values.dtype.kind in "OU" and kind != "str":
        return np.zeros(values.shape, kind)
    with np.errstate(all="ignore"):
        return values.astype(object if kind == "str" else kind) if kind != "str" else values.astype(str).astype(object)


def _mutate_number(dataset: xr.Dataset, random: np.random.Generator) -> tuple[xr.Dataset, str]:
    names = [name for name, variable in dataset.variables.items() if variable.size and variable.dtype.kind in "fiub"]
    name = str(random.choice(names))
    variable = dataset[name]
    values = np.array(variable.values)
    at = int(random.integers(values.size))
    if values.dtype.kind == "f":
        new = random.choice([np.nan, np.inf, -np.inf, 1e12, -1e300, 1e-300, 0.0, -1.0])
    else:
        values = values.astype(np.int64)
        new = random.choice([-1, -2, 2, 3, 100, 255, 256, 10**12, -(10**12), 2**62])
    values.flat[at] = new
    dataset = dataset.drop_vars(name) if name in dataset.coords else dataset
    dataset[name] = (variable.dims, values, variable.attrs)
    return dataset, f"{name}[{at}] = {new}"


def _mutate_attribute(dataset: xr.Dataset, random: np.random.Generator) -> tuple[xr.Dataset, str]:
    name = str(random.choice(list(dataset.attrs)))
    how = int(random.integers(7))
    if how == 0:
        del dataset.attrs[name]
        return dataset, f"without {name}"
    new = ["", "text", -1, 10**12, np.nan, [1.0, 2.0], np.inf][how - 1 if how else 0]
    dataset.attrs[name] = new
    return dataset, f"{name} = {new!r}"


def _mutate_json(dataset: xr.Dataset, random: np.random.Generator) -> tuple[xr.Dataset, str]:
    names = [name for name, value in dataset.attrs.items() if isinstance(value, str) and value[:1] in ("{", "[")]
    name = str(random.choice(names))
    if random.random() < 0.1:
        dataset.attrs[name] = str(random.choice(["{", "[" * 100_000, "1" * 10_000, '{"a":' * 50_000, "NaN", "null"]))
        return dataset, f"{name} is no JSON, or too much"
    value = json.loads(dataset.attrs[name])
    holder: Any = SimpleNamespace(value=value)
    part, key, depth = holder, "value", 0
    while True:
        inner = getattr(part, key) if part is holder else part[key]
        if not isinstance(inner, dict | list) or not inner or (depth and random.random() < 0.25):
            break
        keys = list(inner) if isinstance(inner, dict) else range(len(inner))
        part, key, depth = inner, keys[int(random.integers(len(keys)))], depth + 1
    new = JUNK[int(random.integers(len(JUNK)))]
    how = int(random.integers(4))
    if part is holder:
        holder.value = new
    elif how == 0:
        del part[key]
    elif how == 1 and isinstance(part, dict):
        part[f"{key}_"] = part.pop(key)
    else:
        part[key] = new
    dataset.attrs[name] = json.dumps(holder.value)
    return dataset, f"{name}, {key!r}: {['deleted', 'renamed', 'replaced', 'replaced'][how]} by {str(new)[:20]!r}"


def tried(path: Path, result: Result) -> str:
    """Load a file and use what is in it: "told", "used", or what was raised that is no error of saltus."""
    try:
        found = load(path)
    except SaltusError as error:
        lines = str(error).splitlines()
        return "told" if len(lines) == 1 else f"told in {len(lines)} lines"
    except Exception as error:
        return f"load: {type(error).__name__}: {error}"[:300]
    if getattr(found, "system", None) != getattr(result, "system", None):
        repr(found)
        return "another system"  # whose compilation would take its time
    try:
        use(found)
    except SaltusError:
        return "told at use"
    except Exception as error:
        return f"use: {type(error).__name__}: {error}"[:300]
    return "used"
