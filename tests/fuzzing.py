"""Calls of public functions with arguments of wrong kinds, and what may come of them: a result, or one line that helps.

`objects` makes what is called, `calls` lists each function with arguments that it takes, `VALUES` what replaces some of
them. A seed gives the same calls again.
"""

from __future__ import annotations

import datetime
import itertools
import math
import pickle
import random
import signal
import types
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import sympy

import discrete
import fields
import saltus
import systems
import wells
from grouped import Grouped
from saltus import afm, basins
from saltus.options import (
    AttractorOptions,
    BasinOptions,
    BranchOptions,
    Criteria,
    ErosionOptions,
    OptimumOptions,
    SimulationOptions,
    SweepOptions,
)
from saltus.results import Basins, Branch, PeriodicOrbit

LONGEST_MESSAGE = 300
"""Characters that a message stays below."""

PATIENCE = 30.0
"""Seconds after which a call hangs."""


class Mute:
    """An object whose representation raises."""

    def __repr__(self) -> str:
        raise RuntimeError("no representation")


class Talker:
    """An object with a representation of a million characters."""

    def __repr__(self) -> str:
        return "talk\n" * 200_000


class Anything:
    """A class that can be called with whatever there is."""

    def __init__(self, *_: Any) -> None:
        pass


class Hostile:
    """An object that raises whatever is asked of it."""

    def __getattr__(self, name: str) -> Any:
        raise RuntimeError(name)

    def __iter__(self) -> Iterator[Any]:
        raise RuntimeError("no items")

    def __len__(self) -> int:
        raise RuntimeError("no length")

    def __float__(self) -> float:
        raise RuntimeError("no number")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("no comparison")

    __hash__ = None  # type: ignore[assignment]


class Broken(Mapping[str, Any]):
    """A mapping whose items cannot be had."""

    def __getitem__(self, key: str) -> Any:
        raise RuntimeError(key)

    def __iter__(self) -> Iterator[str]:
        return iter(("A", "x"))

    def __len__(self) -> int:
        return 2


NEVER: dict[str, Callable[[], Any]] = {
    "complex": lambda: 1j,
    "complex without imaginary part": lambda: 1.0 + 0j,
    "complex array": lambda: np.array([1.0 + 0j, 2.0]),
    "complex scalar": lambda: np.complex128(0.5),
    "bytes": lambda: b"0.5",
    "bytearray": lambda: bytearray(b"xv"),
    "date": lambda: datetime.date(2020, 1, 1),
    "moment": lambda: np.datetime64("2020-01-01"),
    "moments": lambda: np.array(["2020-01-01", "2020-01-02"], dtype="M8[D]"),
    "duration": lambda: np.timedelta64(1, "s"),
    "durations": lambda: np.array([1, 2], dtype="m8[s]"),
    "interval with a truth value": lambda: (0.0, True),
    "truth values": lambda: np.array([True, False]),
    "numbers as texts": lambda: ["0.5", "1.0"],
    "records": lambda: np.zeros(2, dtype=[("a", "f8")]),
    "hostile": Hostile,
    "imaginary unit": lambda: sympy.I,
}
"""What is accepted for no argument at all (but that of a constructor which is checked later)."""

VALUES: dict[str, Callable[[], Any]] = NEVER | {
    "None": lambda: None,
    "True": lambda: True,
    "NumPy's False": lambda: np.False_,
    "zero": lambda: 0,
    "minus one": lambda: -1,
    "one": lambda: 1,
    "float": lambda: 0.75,
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "minus inf": lambda: -math.inf,
    "tiny": lambda: 5e-324,
    "large": lambda: 1e308,
    "million million": lambda: 10**12,
    "2^70": lambda: 2**70,
    "10^400": lambda: 10**400,
    "-10^5000": lambda: -(10**5000),
    "fraction": lambda: Fraction(1, 3),
    "large fraction": lambda: Fraction(10**400, 3),
    "decimal": lambda: Decimal("0.5"),
    "signalling": lambda: Decimal("sNaN"),
    "pi": lambda: sympy.pi,
    "symbol": lambda: sympy.Symbol("x"),
    "long float": lambda: np.longdouble("1e4000"),
    "empty text": lambda: "",
    "text": lambda: "nonsense",
    "state": lambda: "x",
    "null": lambda: "a\0b",
    "lines": lambda: "a\nb",
    "markup": lambda: "<script>[bold]",
    "surrogate": lambda: "\ud800",
    "long text": lambda: "long" * 250_000,
    "dunder": lambda: "__class__",
    "call": lambda: "max(",
    "list": lambda: [],
    "tuple": lambda: (),
    "dict": lambda: {},
    "set": lambda: {1.0, 2.0},
    "numbers": lambda: [0.5, 1.0],
    "three": lambda: (0.5, 1.0, 1.5),
    "falling": lambda: (1.0, 0.0),
    "mixed": lambda: [1.0, "a", None],
    "texts": lambda: ["a", "b"],
    "ragged": lambda: [[1.0], [1.0, 2.0]],
    "nested": lambda: [[[[1.0]]]],
    "nan inside": lambda: [0.5, math.nan],
    "large inside": lambda: [0.5, 10**400],
    "empty array": lambda: np.zeros(0),
    "matrix": lambda: np.zeros((2, 2)),
    "cube": lambda: np.ones((1, 2, 3)),
    "array of texts": lambda: np.array(["x", "v"]),
    "array of objects": lambda: np.array([1.0, None], dtype=object),
    "masked": lambda: np.ma.array([0.5, 1.0], mask=[False, True]),
    "masked scalar": lambda: np.ma.masked,
    "mapping": lambda: {"x": 0.5},
    "mapping of numbers": lambda: {1: 2.0},
    "mapping of texts": lambda: {"A": "x"},
    "mapping of complex": lambda: {"A": 1j},
    "mapping of truth values": lambda: {"A": True},
    "mapping of intervals": lambda: {"x": (0.0, 1.0), "v": 0.0},
    "mapping of objects": lambda: {"A": Mute(), "x": Talker()},
    "broken mapping": Broken,
    "generator": lambda: (value for value in (0.5, 1.0)),
    "endless": lambda: itertools.count(),
    "failing generator": lambda: (1 / 0 for _ in range(2)),
    "range": lambda: range(3),
    "function": lambda: lambda *_: None,
    "class": lambda: Anything,
    "class of systems": lambda: saltus.HybridSystem,
    "class of orbits": lambda: PeriodicOrbit,
    "object": object,
    "mute": Mute,
    "list of mutes": lambda: [Mute(), Mute()],
    "talker": Talker,
    "module": lambda: types,
    "ellipsis": lambda: ...,
    "not implemented": lambda: NotImplemented,
    "slice": lambda: slice(3),
    "path": lambda: Path("nowhere/at/all.nc"),
    "folder": lambda: Path("/"),
    "long path": lambda: "a" * 300 + ".nc",
}


CALLBACKS = ("attractors", "measures", "progress")
"""Arguments that may be classes, which then raise what they like."""

ENDLESS = frozenset(("million million", "large", "2^70", "function", "class"))
"""With which a call may take as long as it is asked to."""


@dataclass(frozen=True)
class Call:
    """A function with arguments that it takes.

    Attributes
    ----------
    function : callable
    arguments : dict
        By name; ``*names`` is what is passed on by position.
    later : bool
        Whether wrong kinds are refused only where the result is used.
    """

    function: Callable[..., Any]
    arguments: dict[str, Any] = field(default_factory=dict)
    later: bool = False


@dataclass(frozen=True)
class Tried:
    """What came of a call: ``returned``, ``told``, ``leaked``, ``silent``, ``hung``, ``long`` or ``unpicklable``."""

    name: str
    replaced: dict[str, str]
    ended: str
    said: str = ""

    @property
    def good(self) -> bool:
        """Whether it is what should come."""
        return self.ended in ("returned", "told", "as long as asked")


class Hung(BaseException):
    """A call took too long."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise `Hung` in a block that takes too long."""

    def stop(*_: Any) -> None:
        raise Hung

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def tried(name: str, call: Call, replaced: dict[str, str], seconds: float = PATIENCE) -> Tried:
    """Return what comes of a call in which some arguments are replaced by values by name."""
    arguments = dict(call.arguments) | {argument: VALUES[value]() for argument, value in replaced.items()}
    given = arguments.pop("*names", ())
    try:
        with limited(seconds), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call.function(*(given if isinstance(given, tuple) else (given,)), **arguments)
    except saltus.SaltusError as error:
        said = str(error)
        if len(said) >= LONGEST_MESSAGE or "\n" in said:
            return Tried(name, replaced, "long", said[:LONGEST_MESSAGE])
        error.__cause__ = error.__context__ = None  # another library's error need not survive
        again = str(pickle.loads(pickle.dumps(error)))
        return Tried(name, replaced, "told" if again == said else "unpicklable", said)
    except Hung:
        return Tried(name, replaced, "as long as asked" if ENDLESS.intersection(replaced.values()) else "hung")
    except Exception as error:
        place = error.__traceback__
        while place is not None and place.tb_next is not None:
            place = place.tb_next
        where = "" if place is None else f" at {Path(place.tb_frame.f_code.co_filename).name}:{place.tb_lineno}"
        try:
            said = str(error)[:150]
        except Exception:  # the argument's own
            said = ""
        return Tried(name, replaced, "leaked", f"{type(error).__name__}{where}: {said}")
    silent = [argument for argument, value in replaced.items() if value in NEVER]
    return Tried(name, replaced, "silent" if silent and not call.later else "returned")


def drawn(listed: Mapping[str, Call], count: int, seed: int) -> Iterator[tuple[str, Call, dict[str, str]]]:
    """Go through random calls: one argument replaced mostly, sometimes two or three."""
    chance = random.Random(seed)
    names, values = sorted(listed), sorted(VALUES)
    for _ in range(count):
        name = chance.choice(names)
        arguments = sorted(listed[name].arguments)
        many = min(chance.choice((1, 1, 1, 1, 1, 2, 3)), len(arguments))
        chosen = chance.sample(arguments, many)
        replaced = {argument: chance.choice(values) for argument in chosen}
        for argument in CALLBACKS:
            if replaced.get(argument, "").startswith("class of"):
                replaced[argument] = "class"
        yield name, listed[name], replaced


@dataclass
class Objects:
    """Results of one system that methods are called on."""

    system: Any
    orbit: Any
    branch: Any
    locus: Any
    rests: Any
    folds: Any
    family: Any
    sweep: Any
    trajectory: Any
    spectrum: Any
    table: Any
    classifier: Any
    setup: Any


def objects() -> Objects:
    """Return small results of the impact oscillator."""
    system = systems.impact_oscillator()
    orbit = saltus.solve_orbit(system, {}, [("free", "impact", [1.0, -1.3, 0.1], 6.28)])
    branch = saltus.continue_orbit(orbit, "A", (0.09, 1.05))
    few = saltus.StepControl(max_points=3)
    bounds = {"A": (0.05, 0.2), "e": (0.7, 0.9)}
    x = np.linspace(-0.95, 0.95, 20)
    outside = np.hypot(*np.meshgrid(x, x, indexing="ij")) > 0.6
    takens = saltus.find_equilibrium(fields.system(fields.TAKENS, {"b1": -1.0, "b2": -1.0}), x0=[-1.0, 0.0])
    rests = saltus.continue_equilibrium(takens, "b1", (-2.0, 2.0))
    return Objects(
        rests=rests,
        folds=saltus.continue_locus(rests["SN1"], ("b1", "b2"), {"b1": (-1.0, 1.0), "b2": (-2.0, 1.0)}, steps=few),
        system=system,
        orbit=orbit,
        branch=branch,
        locus=saltus.continue_locus(branch["SN1"], ("A", "e"), bounds, steps=few),
        family=saltus.continue_family(
            orbit, "A", {"d": [1.0, 1.01]}, (0.9, 1.05), options=BranchOptions(few), workers=1
        ),
        sweep=saltus.run_sweep(system, "A", [0.5, 0.6], options=SweepOptions(discard=5, keep=3, workers=1)),
        trajectory=saltus.simulate(system, {}, [0.0, 0.0], periods=3),
        spectrum=saltus.lyapunov_spectrum(system, {}, [0.0, 0.0], average=saltus.Average(periods=10)),
        table=basins.Basins.from_array(outside, {"x": x, "v": x}, {"a": 0, "b": 1}, {"a": [[0.0, 0.0]]}),
        classifier=types.SimpleNamespace(
            grid=basins.Grid(("x", "v"), {"x": (-1, 1, 10), "v": (-1, 1, 10)}),
            attractors=basins.Outcomes({"a": 0, "b": 1}),
            classify=lambda points, engine=None: (points[:, 0] > 0.2).astype(np.uint8),
        ),
        setup=afm.table1(),
    )


def calls(made: Objects, folder: Path) -> dict[str, Call]:
    """Return public functions and methods with arguments that they take; none compiles a system of its own."""
    return (
        _of_systems(made)
        | _of_maps()
        | _of_curves(made)
        | _of_equilibria(made)
        | _of_basins(made)
        | _of_afm(made)
        | _of_files(made, folder)
    )


def lengthy_calls(made: Objects, folder: Path) -> dict[str, Call]:
    """Return calls that take longer, of systems of their own: searches of attractors, maps, cascades, films."""
    well = wells.double_well()
    region = {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}
    search = AttractorOptions(samples=100, longest=300)
    found = saltus.find_attractors(well, {}, region, options=replace(search, starts=8))
    box = {"x": (-1.0, 1.0, 3), "v": 0.0}
    mapped = saltus.map_basins(well, {}, box, found)
    logistic = systems.carried_map(("x",), {"r": 2.8}, {"x": "r*x*(1 - x)"})
    fixed = saltus.solve_orbit(logistic, {}, [("carry", "map", [0.64, 0.0], 1.0)])
    doubling = saltus.continue_orbit(fixed, "r", (2.5, 3.2))["PD1"]
    tapping = afm.tapping_mode(made.setup)
    tap = afm.settled_orbit(tapping, {"Omega": 1.15})
    profile = saltus.erosion_profile(
        well, "A", [0.05], box, options=ErosionOptions(measures=["GIM"], attractors=lambda _: found)
    )
    options = {
        "engine": "cpu", "longest": 200, "tolerance": 1e-6, "preview": False, "interval": None, "progress": False,
    }  # fmt: skip
    return {
        "find_attractors, found": Call(
            saltus.find_attractors,
            {"system": well, "parameters": {}, "region": region, "options": replace(search, starts=4)},
        ),
        "map_basins, mapped": Call(
            Grouped(saltus.map_basins, options=BasinOptions),
            {"system": well, "parameters": {}, "grid": box, "attractors": found, "path": None, **options},
        ),
        "erosion_profile, made": Call(
            Grouped(
                saltus.erosion_profile, options=Grouped(ErosionOptions, basins=BasinOptions)
            ),
            {
                "system": well, "parameter": "c", "values": [0.5], "grid": box, "measures": ["GIM"], "path": None,
                "parameters": {}, "attractors": lambda _: found, "within": None, **options,
            },
        ),
        "ErosionProfile.of": Call(profile.of, {"measure": "GIM", "attractor": found.names[0]}),
        "ErosionProfile.plot": Call(profile.plot, {"measure": "GIM", "ax": None, "legend": True}),
        "Basins.classify": Call(mapped.classify, {"points": [[0.0, 0.0]], "engine": "cpu"}),
        "Basins.label_error": Call(mapped.label_error, {"cells": 2, "by_events": 1, "tolerance": 1e-10, "rng": 0}),
        "switch_branch at a doubling": Call(saltus.switch_branch, {"point": doubling}),
        "follow_cascade, followed": Call(
            saltus.follow_cascade,
            {
                "start": doubling, "bounds": (2.5, 3.5), "doublings": 1, "steps": saltus.StepControl(max_points=20),
                "progress": False,
            },
        ),
        "settled_orbit, settled": Call(
            afm.settled_orbit, {"system": tapping, "parameters": {"Omega": 1.15}, "regime": "repulsive"}
        ),
        "animate, filmed": Call(
            afm.animate,
            {
                "orbit": tap, "path": folder / "film.gif", "setup": made.setup, "fps": 2, "seconds": 1.0, "width": 320,
                "progress": False,
            },
        ),
    }  # fmt: skip


def _of_systems(made: Objects) -> dict[str, Call]:
    system, trajectory, sweep = made.system, made.trajectory, made.sweep
    start = {"system": system, "parameters": {"A": 1.0}, "x0": [0.0, 0.0], "mode": "free"}
    steps = {"tolerance": (1e-8, 1e-10)}
    part = {"t_start": 0.0, "t_end": 6.0}
    averaged = Grouped(saltus.lyapunov_spectrum, average=saltus.Average)
    field = {"x": "v", "v": "-0.1*v - x - x**3 + A*cos(s)"}
    smooth = saltus.HybridSystem.smooth(field, {"A": 0.3, "w": 1.2}, phase=("s", "w"))
    return {
        "HybridSystem": Call(_defined, _definition()),
        "HybridSystem.from_definition": Call(saltus.HybridSystem.from_definition, {"definition": system.definition()}),
        "resolve": Call(system.resolve, {"parameters": {"A": 1.0}}),
        "allowed": Call(system.allowed, {"parameter": "A"}),
        "field": Call(system.field, {"mode": "free", "state": [0.0, 0.0], "parameters": {}}),
        "full_state": Call(system.full_state, {"x0": [0.0, 0.0]}),
        "mode_index": Call(system.mode_index, {"mode": "free"}),
        "parameter_vector": Call(system.parameter_vector, {"parameters": {}}),
        "simulate": Call(
            Grouped(saltus.simulate, options=SimulationOptions),
            {**start, **steps, "periods": 2, "max_events": 100, "max_steps": 500},
        ),
        "simulate for a time": Call(saltus.simulate, {**start, **steps, "t_end": 3.0}),
        "find_orbit": Call(saltus.find_orbit, {**start, "settle": 200.0, "tolerance": 1e-10}),
        "solve_orbit": Call(
            saltus.solve_orbit,
            {
                "system": system,
                "parameters": {},
                "segments": [("free", "impact", [1.0, -1.3, 0.1], 6.28)],
                "tolerance": 1e-10,
            },
        ),
        "solve_orbit at a maximum": Call(
            saltus.solve_orbit,
            {
                "system": smooth, "parameters": {"A": 0.3}, "x0": [0.5, 0.0], "period": 5.236, "fix": {"max_x": 0.6},
                "free": "A",
            },
        ),
        "HybridSystem.smooth": Call(
            saltus.HybridSystem.smooth,
            {
                "field": {"x": "v", "v": "-k*x"}, "parameters": {"k": 1.0}, "phase": ("s", "k"),
                "outputs": {"e": "x*v"}, "positive": ["k"], "name": "spring",
            },
        ),
        "a segment": Call(
            lambda **parts: saltus.solve_orbit(system, {}, [tuple(parts.values())]),
            {"mode": "free", "transition": "impact", "x0": [1.0, -1.3, 0.1], "duration": 6.28},
        ),
        "lyapunov_spectrum": Call(
            averaged, {**start, **steps, "periods": 5, "discard": 2, "exponents": 1}
        ),
        "lyapunov_spectrum for a time": Call(averaged, {**start, "t_end": 5.0, "discard": 2.0}),
        "run_sweep": Call(
            Grouped(saltus.run_sweep, options=SweepOptions),
            {
                **start, **steps, "parameter": "A", "values": [0.5], "discard": 3, "keep": 2, "follow": "up",
                "chunks": 1, "section": None, "quantities": ["x"], "observables": ["max(x)"], "exponents": 1,
                "criteria": Criteria(longest=1, fewest=20), "workers": 1, "client": None, "path": None,
                "progress": False,
            },
        ),
        "Section": Call(saltus.Section, {"event": "x - 0.5", "direction": 1}),
        "Criteria": Call(Criteria, dict.fromkeys(("recurrence", "settling", "gap"), 0.1) | {"longest": 3}),
        "trajectory()": Call(trajectory, {"t": 1.0}),
        "mode_at": Call(trajectory.mode_at, {"t": 1.0}),
        "output": Call(trajectory.output, {"expression": "x + v", "t": [0.5, 1.0]}),
        "Trajectory.motion": Call(trajectory.motion, dict(part)),
        "Trajectory.observe": Call(trajectory.observe, {"*names": "max(x)", **part}),
        "spectrum": Call(trajectory.spectrum, {"expression": "x", **part, "samples": 16, "window": "hann"}),
        "Trajectory.plot": Call(trajectory.plot, {"x": "t", "y": "x", "ax": None, "legend": True}),
        "Sweep.at": Call(sweep.at, {"value": 0.55, "direction": "up"}),
        "Sweep.column": Call(sweep.column, {"name": "x"}),
        "Sweep.runs": Call(sweep.runs, {"direction": "up"}),
        "Sweep.plot": Call(sweep.plot, {"y": "x", "panels": None, "ax": None, "legend": True}),
        "LyapunovSpectrum.plot": Call(made.spectrum.plot, {"ax": None, "legend": True}),
    }  # fmt: skip


def _of_maps() -> dict[str, Call]:
    tent = discrete.tent_of()
    start = {"parameters": {"a": 1.5}, "x0": [0.3]}
    iterates = saltus.iterate(tent, x0=[0.3], n=5)
    piece = {"x": [0.3], "parameters": {"a": 1.5}}
    return {
        "Map": Call(
            saltus.Map,
            {
                "states": ("x",), "parameters": {"a": 1.5}, "image": {"x": "a*x*(1 - x)"}, "pieces": None,
                "outputs": {"double": "2*x"}, "groups": {"all": ["a"]}, "positive": ("a",),
                "parameter_bounds": {"a": (0.0, 4.0)}, "name": "fuzz",
            },
        ),
        "Map of pieces": Call(
            lambda image, where: saltus.Map(
                ("x",), {}, pieces={"low": saltus.Piece(image, where), "high": saltus.Piece({"x": "x"}, "x")}
            ),
            {"image": {"x": "x/2"}, "where": "-x"},
        ),
        "Map.from_definition": Call(saltus.Map.from_definition, {"definition": tent.definition()}),
        "Map.piece_of": Call(tent.piece_of, dict(piece)),
        "Map.image": Call(tent.image, dict(piece)),
        "Map.jacobian": Call(tent.jacobian, dict(piece)),
        "iterate": Call(saltus.iterate, {"system": tent, **start, "n": 3, "discard": 2}),
        "Iterates.output": Call(iterates.output, {"expression": "double + a"}),
        "Iterates.observe": Call(iterates.observe, {"*names": "mean(x)"}),
        "Iterates.plot": Call(
            iterates.plot, {"x": "n", "y": "x", "cobweb": False, "ax": None, "legend": True}
        ),
        "lyapunov_spectrum of a map": Call(
            Grouped(saltus.lyapunov_spectrum, average=saltus.Average),
            {"system": tent, **start, "mode": None, "periods": 5, "discard": 2, "exponents": 1},
        ),
        "run_sweep of a map": Call(
            Grouped(saltus.run_sweep, options=SweepOptions),
            {
                "system": tent, **start, "mode": None, "parameter": "a", "values": [1.5], "discard": 3, "keep": 2,
                "section": None, "quantities": ["x"], "observables": ["max(x)"], "exponents": 1, "path": None,
            },
        ),
    }  # fmt: skip


def _definition() -> dict[str, Any]:
    """Arguments of a system by name, those of its mode and of its transition one by one."""
    return {
        "states": ("x", "v"), "parameters": {"c": 0.1, "d": 1.0, "e": 0.8, "w": 1.0},
        "field": {"x": "v", "v": "-x - c*v + cos(theta)"}, "domain": None,
        "source": "free", "target": "free", "event": "x - d", "direction": 1, "reset": {"v": "-e*v"}, "when": None,
        "transition": "impact", "phase": ("theta", "w"), "outputs": {"gap": "d - x"}, "groups": {"all": ["c", "e"]},
        "positive": ("w",), "parameter_bounds": {"c": (0.0, 1.0)}, "regimes": {"free": ("free",)}, "name": "fuzz",
    }  # fmt: skip


def _defined(**parts: Any) -> saltus.HybridSystem:
    mode = saltus.Mode(parts.pop("field"), parts.pop("domain"))
    transition = saltus.Transition(
        *(parts.pop(name) for name in ("source", "target", "event", "direction", "reset", "when", "transition"))
    )
    return saltus.HybridSystem(modes={"free": mode}, transitions=[transition], **parts)


def _of_curves(made: Objects) -> dict[str, Call]:
    orbit, branch, locus, family = made.orbit, made.branch, made.locus, made.family
    few = saltus.StepControl(max_points=3)
    ways = {"directions": "up", "stop_at": "SN", "steps": few, "progress": False}
    here = {"orbit": orbit, "parameter": "A", "bounds": (0.9, 1.05)}
    events = {"events": {"max_x": 1.0}}
    picture = {"ax": None, "special": True, "legend": True}
    return {
        "StepControl": Call(
            saltus.StepControl,
            {
                "initial": 0.01, "smallest": 1e-8, "largest": 0.1, "angle": 0.5, "iterations": 5, "max_points": 10,
                "at_grazing": "pass",
            },
        ),
        "BranchOptions": Call(
            BranchOptions, {**events, "directions": "up", "stop_at": "SN", "steps": few}
        ),
        "continue_orbit": Call(saltus.continue_orbit, {**here, **events, **ways}),
        "continue_family": Call(
            saltus.continue_family, {
                **here, "over": {"d": [1.0]}, "options": BranchOptions(few), "workers": 1, "client": None,
                "progress": False,
            },
        ),
        "continue_locus": Call(
            saltus.continue_locus,
            {
                **ways, "start": branch["SN1"], "parameters": ("A", "e"), "type": "SN",
                "bounds": {"A": (0.05, 0.2), "e": (0.7, 0.9)}, "stop_at": "CP",
            },
        ),
        "optimise": Call(
            Grouped(saltus.optimise, options=OptimumOptions),
            {
                "start": orbit, "maximise": "max(v)", "minimise": "", "vary": {"A": (0.9, 1.05)},
                "subject_to": {"min_x": (-9.0, None), "stable": False}, "margin": 0.01, "reach": 0.1, "max_orbits": 3,
                "progress": False,
            },
        ),
        "switch_branch": Call(saltus.switch_branch, {"point": branch["GR1"]}),
        "grazing_orbits": Call(saltus.grazing_orbits, {"point": branch["GR1"]}),
        "follow_cascade": Call(
            saltus.follow_cascade,
            {"start": branch["SN1"], "bounds": (0.0, 1.0), "doublings": 1, "steps": few, "progress": False},
        ),
        "sample": Call(orbit.sample, {"points": 20}),
        "PeriodicOrbit.observe": Call(orbit.observe, {"*names": "max(x)"}),
        "problem": Call(orbit.problem, {"active": "A", "scale": 1.0}),
        "PeriodicOrbit.plot": Call(orbit.plot, {"x": "x", "y": "v", "ax": None, "legend": True}),
        "branch[]": Call(branch.__getitem__, {"label": "SN1"}),
        "Branch.at": Call(branch.at, {"value": float(branch.values[0])}),
        "Branch.value_at": Call(branch.value_at, {"point": branch["SN1"], "name": "A"}),
        "Branch.column": Call(branch.column, {"name": "A"}),
        "Branch.observe": Call(locus.observe, {"*names": "max(x)"}),
        "Branch.solution": Call(branch.solution, {"index": 1}),
        "Branch.signature": Call(branch.signature, {"index": 1}),
        "Branch.plot": Call(branch.plot, {"x": "A", "y": "max_x", **picture}),
        "Locus.displacement": Call(locus.displacement, {"of": "A", "parameters": ["w"]}),
        "Locus.point": Call(locus.point, {"index": 0}),
        "Locus.plot": Call(locus.plot, {"x": "A", "y": "e", "z": None, **picture}),
        "family[]": Call(family.__getitem__, {"index": 0}),
        "Family.plot": Call(family.plot, {"x": "A", "y": "max_x", "over": "d", "projection": "2d", **picture}),
    }  # fmt: skip


def _of_equilibria(made: Objects) -> dict[str, Call]:
    rests, folds = made.rests, made.folds
    few = saltus.StepControl(max_points=3)
    ways = {"directions": "up", "stop_at": "SN", "steps": few, "progress": False}
    picture = {"ax": None, "special": True, "legend": True}
    return {
        "find_equilibrium": Call(
            saltus.find_equilibrium,
            {"system": rests.system, "parameters": {"b1": -1.0}, "x0": [-1.0, 0.0], "mode": "flow"},
        ),
        "continue_equilibrium": Call(
            saltus.continue_equilibrium,
            {
                **ways, "equilibrium": rests.solution(1), "parameter": "b1", "bounds": (-2.0, 2.0),
                "events": {"x": 0.0},
            },
        ),
        "continue_locus of equilibria": Call(
            saltus.continue_locus,
            {
                **ways, "start": rests["SN1"], "parameters": ("b1", "b2"), "type": "SN",
                "bounds": {"b1": (-1.0, 1.0), "b2": (-2.0, 1.0)}, "stop_at": "BT",
            },
        ),
        "switch_branch at a Hopf point": Call(saltus.switch_branch, {"point": rests["HB1"]}),
        "equilibrium[]": Call(rests.solution(0).__getitem__, {"state": "x"}),
        "Equilibrium.problem": Call(rests.solution(0).problem, {"*names": "b1"}),
        "Equilibrium.plot": Call(rests.solution(0).plot, {"ax": None, "legend": True}),
        "EquilibriumBranch[]": Call(rests.__getitem__, {"label": "SN1"}),
        "EquilibriumBranch.at": Call(rests.at, {"value": float(rests.values[0])}),
        "EquilibriumBranch.value_at": Call(rests.value_at, {"point": rests["SN1"], "name": "x"}),
        "EquilibriumBranch.column": Call(rests.column, {"name": "x"}),
        "EquilibriumBranch.solution": Call(rests.solution, {"index": 1}),
        "EquilibriumBranch.plot": Call(rests.plot, {"x": "b1", "y": "x", **picture}),
        "EquilibriumLocus.point": Call(folds.point, {"index": 0}),
        "EquilibriumLocus.plot": Call(folds.plot, {"x": "b1", "y": "b2", "z": None, **picture}),
    }  # fmt: skip


def _of_basins(made: Objects) -> dict[str, Call]:
    table, system = made.table, made.system
    x = np.linspace(-0.5, 0.5, 4)
    region = {"x": (-0.5, 0.5), "v": (-0.5, 0.5)}
    box = {"x": (-0.5, 0.5, 3), "v": 0.0}
    measured = {"basins": table, "name": "a", "weights": {"x": 1.0, "v": 2.0}}
    options = {
        "engine": "cpu", "longest": 20, "tolerance": 1e-6, "preview": False, "interval": None, "progress": False,
    }  # fmt: skip
    return {
        "find_attractors": Call(
            saltus.find_attractors,
            {
                "system": system, "parameters": {}, "region": {"x": (5.0, 6.0), "v": 0.0},
                "options": AttractorOptions(starts=1, samples=100, longest=2),
            },
        ),
        "attractors_from": Call(basins.attractors_from, {"orbits": {"a": made.branch["SN1"].orbit}, "region": region}),
        "AttractorOptions": Call(
            AttractorOptions, {"starts": 4, "motions": 10, "interval": 1.0, "rng": 1, "longest": 10, "samples": 100,
                "safety": 0.5, "tolerance": 1e-6,
            },
        ),
        "map_basins": Call(
            Grouped(saltus.map_basins, options=BasinOptions),
            {
                "system": system, "parameters": {}, "grid": box, "attractors": {"options": "none"}, "path": None,
                **options,
            },
        ),
        "erosion_profile": Call(
            Grouped(
                saltus.erosion_profile, options=Grouped(ErosionOptions, basins=BasinOptions)
            ),
            {
                "system": system, "parameter": "A", "values": [0.5], "grid": box, "measures": ["GIM"], "path": None,
                "parameters": {}, "attractors": lambda parameters: table, "within": 0.1, **options,
            },
        ),
        "Grid": Call(basins.Grid, {"states": ("x", "v"), "axes": box}),
        "a range": Call(
            lambda **ends: basins.Grid(("x",), {"x": tuple(ends.values())}), {"low": 0, "high": 1, "count": 3}
        ),
        "Grid.nearest": Call(table.grid.nearest, {"values": {"x": 0.1}}),
        "Plane": Call(
            lambda **parts: basins.Grid(("x", "v"), saltus.Plane(**parts)),
            {
                "origin": {"x": 0.0, "v": 0.0}, "u": {"x": 1.0}, "v": {"v": 1.0}, "extents": ((-1, 1), (-1, 1)),
                "counts": (2, 2), "names": ("a", "b"),
            },
        ),
        "from_array": Call(
            basins.Basins.from_array,
            {
                "labels": np.zeros((4, 4), int), "axes": {"x": x, "v": x}, "names": {"a": 0},
                "points": {"a": [[0.0, 0.0]]},
            },
        ),
        "classify": Call(table.classify, {"points": [[0.0, 0.0]], "engine": "cpu"}),
        "label_error": Call(table.label_error, {"cells": 1, "by_events": 1, "tolerance": 1e-10, "rng": 0}),
        "Basins.section": Call(table.section, {"x": 0.1}),
        "global_integrity": Call(basins.global_integrity, {"basins": table, "name": "a"}),
        "local_integrity": Call(basins.local_integrity, {**measured, "centre": [0.0, 0.0]}),
        "integrity_factor": Call(basins.integrity_factor, dict(measured)),
        "minimal_fatal_perturbation": Call(basins.minimal_fatal_perturbation, {**measured, "centre": [0.0, 0.0]}),
        "basin_entropy": Call(basins.basin_entropy, {"basins": table, "box": 5}),
        "basin_stability": Call(
            basins.basin_stability,
            {
                "basins": made.classifier, "name": "a", "samples": 5, "region": {"x": (-0.5, 0.5)}, "rng": 0,
                "confidence": 0.9, "engine": "cpu",
            },
        ),
        "uncertainty_by_neighbours": Call(basins.uncertainty_by_neighbours, {"basins": table, "scales": (1, 2, 4)}),
        "uncertainty_by_shifts": Call(
            basins.uncertainty_by_shifts,
            {"basins": made.classifier, "scales": [0.1, 0.2, 0.3], "samples": 500, "weights": None, "rng": 0},
        ),
        "wada_by_merging": Call(basins.wada_by_merging, {"basins": table, "reach": 2}),
        "Basins.plot": Call(table.plot, {"x": "x", "y": "v", "ax": None, "colours": None, "legend": True}),
    }  # fmt: skip


def _of_afm(made: Objects) -> dict[str, Call]:
    setup = made.setup
    lever, sample = setup.cantilever, setup.sample
    solid = {"R": 20e-9, "H": 1e-19, "a0": 2e-10}
    moduli = {"young_tip": 130e9, "poisson_tip": 0.28, "young_sample": 2e9, "poisson_sample": 0.4}
    beam = {"length": 240e-6, "width": 40e-6, "thickness": 2e-6, "density": 2300.0, "young": 170e9}
    return {
        "Cantilever": Call(afm.Cantilever, beam),
        "Cantilever.from_measured": Call(afm.Cantilever.from_measured, {"k": 2.0, "f0": 70e3, "Q": 200.0}),
        "frequencies": Call(lever.frequencies, {"n": 2}),
        "stiffnesses": Call(lever.stiffnesses, {"n": 2}),
        "DMTSample": Call(afm.DMTSample, {**solid, "E_star": 1e10}),
        "DMTSample.from_moduli": Call(afm.DMTSample.from_moduli, {**solid, **moduli}),
        "Setup": Call(afm.Setup, {"cantilever": lever, "sample": sample, "eta": 60e-9}),
        "tip_force": Call(afm.tip_force, {"z": [1e-9, 1e-10], "sample": sample}),
        "tapping_mode": Call(
            afm.tapping_mode, {"setup": setup, "modes": 1, "parameters": {"Omega": 1.1}, "static_term": "consistent"}
        ),
        "settled_orbit": Call(afm.settled_orbit, {"system": made.system, "parameters": {}, "regime": "repulsive"}),
        "animate": Call(
            afm.animate,
            {
                "orbit": made.orbit, "path": "nowhere/film.gif", "setup": setup, "fps": 25, "seconds": 1.0,
                "width": 400, "progress": False,
            },
        ),
    }  # fmt: skip


def _of_files(made: Objects, folder: Path) -> dict[str, Call]:
    read = {kind.__name__: Call(kind.load, {"path": folder / "none.nc"}) for kind in (Branch, Basins)}
    return {
        "load": Call(saltus.load, {"path": folder / "none.nc"}),
        **{f"{name}.load": call for name, call in read.items()},
        "Basins.open": Call(basins.Basins.open, {"path": folder / "none.zarr"}),
        "save": Call(made.trajectory.save, {"path": folder / "trajectory.nc"}),
        "Basins.save": Call(made.table.save, {"path": folder / "table.zarr"}),
    }
