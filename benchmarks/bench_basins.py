"""Motions a second of the basins: lanes, peers at equal accuracy, the figures, the first use of a system, a cluster."""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from basin_accuracy import Truth
from basin_peers import EventDriven, Heyoka, Model, by_scipy, grids, states_of_box, tapping, until_trapped
from measure import interleaved, machine, show

from saltus.afm.paper.figures import sections
from saltus.basins import map_basins
from saltus.basins.map.labelling import TOLERANCE
from saltus.options import BasinOptions

if TYPE_CHECKING:
    from numpy.typing import NDArray

PARTS = ("lanes", "peers", "figures", "first-use", "cluster")

TARGETS = {"Fig. 9": "8.3 us", "[-5, 5]^4": "11.9 us"}
"""Of a motion on one core, by the prototype with AVX-512."""

MOTIONS, REPEATS = 160_000, 5

MAPPED = 200
"""States over which the one-period maps of the peers are compared."""

TOLERANCES = tuple(10.0 ** (-k / 2.0) for k in range(12, 26))
"""From 1e-6 to 3e-13, each 3.2 times tighter."""

UNCERTAINTY_EXPONENT = 0.32
"""Of the boundary in the box: the chance that a label is wrong grows as this power of the error."""

EXACT = 1e-13
"""Tolerance of the flow with which maps are compared."""

FIGURES = """
import json, resource, sys, time
from pathlib import Path
begin = time.perf_counter()
from saltus.afm.paper.figures import {name}
out = Path(sys.argv[1])
found = list({name}.compute(out / "{name}.zarr", {resolution}))
labels = sum(basins.grid.size / basins.orbits_per_second for _, basins in found)
done = time.perf_counter() - begin
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
{name}.run(out, resolution={resolution})
whole = time.perf_counter() - begin
print(json.dumps({{
    "orbits": sum(basins.grid.size for _, basins in found), "labels": labels, "labels and attractors": done,
    "with the picture": whole, "MiB": peak / 1024,
}}))
"""
"""Run in a process of its own: seconds of the labels alone, from the start to the labels, to the picture; memory."""

FIRST_USE = """
import json, time
begin = time.perf_counter()
from saltus import afm, find_attractors
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.traps import Traps
system = afm.tapping_mode(afm.table1(), modes=2, static_term="{static_term}")
model = time.perf_counter() - begin
Ensemble(system, {parameters}).settle([[0.1, 0.0, 0.2, 0.0]], Traps(4), 1)
lanes = time.perf_counter() - begin - model
found = find_attractors(system, {parameters}, dict.fromkeys(system.states, (-5.0, 5.0)))
print(json.dumps({{"model": model, "lanes": lanes, "attractors": time.perf_counter() - begin - model - lanes}}))
"""
"""Run in a process of its own: seconds until the model is there, a first motion of lanes ends, attractors are found."""


def main() -> None:
    """Print the tables of the parts that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=PARTS, help=f"of {', '.join(PARTS)}; all by default")
    parser.add_argument("--motions", type=int, default=MOTIONS, help=f"in the parts lanes and peers ({MOTIONS})")
    parser.add_argument("--cells", type=int, default=48, help="that SciPy follows until settled (48)")
    parser.add_argument("--repeats", type=int, default=REPEATS, help=f"of each measurement ({REPEATS})")
    parser.add_argument("--resolution", type=int, default=400, help="of Figs. 9 and 10 (400)")
    parser.add_argument("--resolution-3d", type=int, nargs="*", default=[100], help="of Fig. 8, one or more (100)")
    parser.add_argument("--cluster-resolution", type=int, default=1000, help="of the plane that Dask maps (1000)")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(PARTS):
        parser.error(f"no such part: {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    works: dict[str, Callable[[], None]] = {
        "lanes": lambda: lanes(options.motions, options.repeats),
        "peers": lambda: peers(options.motions, options.cells, options.repeats),
        "figures": lambda: figures(options.resolution, options.resolution_3d),
        "first-use": first_use,
        "cluster": lambda: cluster(options.cluster_resolution, options.repeats),
    }
    print(machine())
    for part in options.parts:
        works[part]()


# ---- lanes ----


def lanes(motions: int, repeats: int) -> None:
    """Time the motions of a plane and of the box until they are in a trap, on one core and on all."""
    cores = len(os.sched_getaffinity(0))
    model, seconds, notes, peer = tapping(2), {}, {}, {}
    works: dict[str, Callable[[], Any]] = {}
    for name, points in _starts(motions).items():
        for threads in sorted({1, cores}):
            ensemble = model.ensemble(threads=threads)
            row = f"{name}, {threads} {'thread' if threads == 1 else 'threads'}"
            works[row] = lambda e=ensemble, x=points: e.settle(x, model.traps)
            if threads == 1:
                ensemble.settle(points[:1], model.traps)
                ensemble.work[:] = 0
                _, strobes = ensemble.settle(points, model.traps)
                steps = ensemble.work.sum() / len(points)
                notes[row] = f"{steps:.0f} lane-steps, {strobes.mean():.1f} periods; prototype {TARGETS[name]}"
            else:
                peer[row] = f"{name}, 1 thread"
    for row, values in interleaved(works, repeats).items():
        seconds[row] = [value / motions for value in values]
        notes[row] = f"{1.0 / min(seconds[row]):,.0f} orbits/s; {notes.get(row, '')}".rstrip("; ")
    show(f"one motion until its fate is certain, {motions} motions", seconds, peer, notes)


def _starts(motions: int) -> dict[str, NDArray[np.float64]]:
    """Cells of Fig. 9's plane in their order, and random states of the box."""
    plane = grids(math.isqrt(motions))["Fig. 9"][1].points()
    return {"Fig. 9": np.resize(plane, (motions, 4)), "[-5, 5]^4": states_of_box(motions, 0)}


# ---- peers ----


def peers(motions: int, cells: int, repeats: int) -> None:
    """Time the same cells of the box by all means, each at the loosest tolerance at which labels are as good.

    A few cells do not show how many labels are wrong. But the chance of that is as the error of the map to the power of
    the uncertainty exponent, so the mean of that power over random states is what has to be equal.
    """
    model, states = tapping(2), states_of_box(MAPPED, 4)
    exact = _mapped(EventDriven(model.system, model.p, EXACT), model, states)
    errors = _errors(model.ensemble().strobe(states)[0], exact)
    print(f"\nlanes at {TOLERANCE:g}, one period of {MAPPED} states of the box: {_told(errors)}")
    followers: dict[str, Callable[[float], tuple[Any, Any]]] = {
        "SciPy DOP853": lambda tol: _alone(by_scipy(tol), model),
        "event-driven flow": lambda tol: _alone(EventDriven(model.system, model.p, tol), model),
        "heyoka, batch": lambda tol: _batched(Heyoka(model, tol)),
    }
    points = states_of_box(cells, 5)
    many = np.resize(points, (motions, 4))  # the same cells, often enough to fill the lanes
    ensemble = model.ensemble(threads=1)
    truth = Truth.of(model)(points)
    works: dict[str, Callable[[], Any]] = {"lanes": lambda: ensemble.settle(many, model.traps)}
    counts, notes = {"lanes": motions}, {"lanes": _equal(ensemble.settle(points, model.traps)[0], truth)}
    several = {"SciPy DOP853": 1, "event-driven flow": 4, "heyoka, batch": 8}
    for name, follower in followers.items():
        try:
            tolerance, settle = _as_exact(name, follower, states, exact, _uncertainty(errors))
        except ImportError:
            continue
        x = np.resize(points, (cells * several[name], 4))
        works[name] = lambda settle=settle, x=x: settle(x)
        counts[name], notes[name] = len(x), f"tolerance {tolerance:.1e}; {_equal(settle(points), truth)}"
    seconds = {name: [value / counts[name] for value in values] for name, values in interleaved(works, repeats).items()}
    fastest = seconds["lanes"]
    for name in list(seconds)[1:]:
        by_median = statistics.median(seconds[name]) / statistics.median(fastest)
        notes[name] += f"; lanes {min(seconds[name]) / min(fastest):,.0f} times faster, by medians {by_median:,.0f}"
    show(f"one motion until its fate is certain, one core, the same {cells} cells of [-5, 5]^4", seconds, {}, notes)


def _alone(period: Any, model: Model) -> tuple[Any, Any]:
    """One period, and the labels, of motions followed one by one."""
    return (
        lambda points: _mapped(period, model, points),
        lambda points: np.array([until_trapped(period, x, model.start(x), model.traps) for x in points], np.uint8),
    )


def _batched(engine: Heyoka) -> tuple[Any, Any]:
    return engine.strobe, engine.settle


def _as_exact(
    name: str,
    follower: Callable[[float], tuple[Any, Any]],
    states: NDArray[np.float64],
    exact: NDArray[np.float64],
    wanted: float,
) -> tuple[float, Any]:
    """Return the loosest tolerance at which labels are as uncertain as the lanes', and what labels cells at it."""
    for tolerance in TOLERANCES:
        strobe, settle = follower(tolerance)
        errors = _errors(strobe(states), exact)
        if _uncertainty(errors) <= wanted:
            break
    print(f"{name} at {tolerance:.1e}: {_told(errors)}")
    return tolerance, settle


def _mapped(period: Any, model: Model, points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([period(x, model.start(x))[0] for x in points])


def _errors(ends: NDArray[np.float64], exact: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(ends - exact).max(axis=1)


def _uncertainty(errors: NDArray[np.float64]) -> float:
    """What the share of wrong labels is in proportion to."""
    return float(np.mean(errors**UNCERTAINTY_EXPONENT))


def _told(errors: NDArray[np.float64]) -> str:
    median, most = np.percentile(errors, (50, 99))
    return f"error {median:.1e} (median), {most:.1e} (99 %); mean of its power {_uncertainty(errors):.1e}"


def _equal(labels: NDArray[np.uint8], truth: NDArray[np.uint8]) -> str:
    return f"{np.sum(labels == truth)} of {len(truth)} labels equal"


# ---- figures ----


def figures(resolution: int, resolutions_3d: Sequence[int]) -> None:
    """Time the figures in processes of their own, what they have compiled being on the disk."""
    wanted = [("fig9", resolution), ("fig10", resolution), *(("fig8", count) for count in resolutions_3d)]
    print("\nfigures, warm caches")
    heads = ("labels", "orbits/s", "labels and attractors", "with the picture", "peak of labels")
    print(f"  {'':12} " + " ".join(f"{head:>22}" for head in heads))
    for name in ("fig9", "fig10", "fig8"):
        _figure(name, 10)
    for name, count in wanted:
        told = _figure(name, count)
        cells = (
            f"{told['labels']:.2f} s", f"{told['orbits'] / told['labels']:,.0f}",
            f"{told['labels and attractors']:.2f} s", f"{told['with the picture']:.2f} s", f"{told['MiB']:.0f} MiB",
        )  # fmt: skip
        print(f"  {f'{name}, {count}':12} " + " ".join(f"{cell:>22}" for cell in cells), flush=True)


def _figure(name: str, resolution: int) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        return _child(FIGURES.format(name=name, resolution=resolution), folder)


def _child(program: str, *arguments: str, **environment: str) -> dict[str, float]:
    """Run a program in a process of its own, and return what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments], env=os.environ | environment, capture_output=True, text=True
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(done.stderr)
    return dict(json.loads(done.stdout.splitlines()[-1]))


# ---- first use ----


def first_use() -> None:
    """Time the first use of a system in fresh processes: with nothing compiled, in a second one, another system's."""
    print("\nfirst use, a process each")
    heads = ("model", "first motion of lanes", "attractors", "whole process")
    print(f"  {'':32} " + " ".join(f"{head:>22}" for head in heads))
    with tempfile.TemporaryDirectory() as folder:
        caches = {"SALTUS_CACHE_DIR": f"{folder}/saltus", "NUMBA_CACHE_DIR": f"{folder}/numba"}
        for row, static_term in (
            ("nothing compiled", "consistent"),
            ("the same, a second process", "consistent"),
            ("a new system", "as-printed"),
            ("the same, a second process", "as-printed"),
        ):
            begin = time.perf_counter()
            program = FIRST_USE.format(static_term=static_term, parameters=dict(sections.PARAMETERS))
            told = _child(program, **caches)
            values = (told["model"], told["lanes"], told["attractors"], time.perf_counter() - begin)
            print(f"  {row:32} " + " ".join(f"{f'{value:.2f} s':>22}" for value in values), flush=True)


# ---- a cluster ----


def cluster(resolution: int, repeats: int) -> None:
    """Time Fig. 9's plane by one and by two worker processes of a thread each, which write their own store."""
    model, grid = tapping(2), grids(resolution)["Fig. 9"][1]
    small = grids(50)["Fig. 9"][1]
    works: dict[str, Callable[[], Any]] = {}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        for workers in (1, 2):
            client = stack.enter_context(_client(workers))
            for _ in range(2 * workers):  # each worker reads what is compiled
                _through(client, model, small, folder)
            works[f"{workers} {'worker' if workers == 1 else 'workers'}"] = lambda client=client: _through(
                client, model, grid, folder
            )
        seconds = {row: [value / grid.size for value in values] for row, values in interleaved(works, repeats).items()}
    notes = {row: f"{1.0 / min(values):,.0f} orbits/s" for row, values in seconds.items()}
    title = f"one motion of {resolution}^2 by Dask, {len(os.sched_getaffinity(0))} cores, workers of one thread"
    show(title, seconds, {"2 workers": "1 worker"}, notes)


def _through(client: Any, model: Model, grid: Any, folder: Path) -> None:
    with tempfile.TemporaryDirectory(dir=folder) as place:
        map_basins(
            model.system,
            sections.PARAMETERS,
            grid,
            model.attractors,
            options=BasinOptions(engine="dask", client=client),
            path=Path(place) / "basins.zarr",
        )


@contextmanager
def _client(workers: int) -> Iterator[Any]:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0") as started,
        Client(started) as client,
    ):
        yield client


if __name__ == "__main__":
    main()
