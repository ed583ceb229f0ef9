"""Whether the fast engine misses contacts: random transients against small steps at the tightest tolerance.

Transients of the tapping-mode AFM with two modes at Omega = 1.15, from states drawn evenly from the box [-5, 5]^4 above
the sample at phase 0, are followed for one forcing period at tolerance 1e-8 by Taylor series, and at 1e-13 by
Runge-Kutta steps of a tenth the length. Where the two do not cross the surface at the same times, each flight and each
contact is followed anew by the small steps from where the engine began it: a crossing that the engine then has not is
one that it missed; otherwise the difference is the error that the motion had gathered before.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from measure import machine

import saltus
from saltus import afm
from saltus.flow.motion import EventDrivenMotion
from saltus.flow.observables import observe
from saltus.flow.poincare import EventSection, iterate

if TYPE_CHECKING:
    from numpy.typing import NDArray

OMEGA, BOX = 1.15, 5.0
PERIOD = 2.0 * math.pi / OMEGA

TOL, TIGHT = 1e-8, 1e-13

PIECES = 300
"""Equal parts of a period into which the steps of the reference are cut: 0.018, where the engine's longest are 0.2."""

SAME = 1e-3
"""Largest difference of the times of a crossing in two motions."""

DEEP = 1e-9
"""Contacts deeper than this should not be missed (in units of the gap at rest)."""

CHUNK = 250


@dataclass(frozen=True)
class Crossings:
    """Crossings of the surface: times, modes before, full states."""

    times: NDArray[np.float64]
    modes: NDArray[np.int64]
    states: NDArray[np.float64]


@dataclass(frozen=True)
class Difference:
    """A transient in which the two do not agree.

    Attributes
    ----------
    start : int
        Its number; with the seed it gives the same start again.
    kind : str
        "missed" or "invented" by the engine, or "gathered", where its error before is what differs.
    time : float
        Of the first crossing that only one has.
    excursion : float
        How far beyond the surface the motion then goes.
    """

    start: int
    kind: str
    time: float
    excursion: float


@cache
def system() -> saltus.HybridSystem:
    """The tapping-mode AFM with two modes."""
    return afm.tapping_mode(afm.table1(), modes=2, parameters={"Omega": OMEGA})


def draw(seed: int, start: int) -> NDArray[np.float64]:
    """Return a state in the box, in flight at phase 0."""
    rng = np.random.default_rng((seed, start))
    surface = system().parameters["a0"] / system().parameters["eta"]
    while True:
        x = rng.uniform(-BOX, BOX, 4)
        if 1.0 - x[0] - x[1] > surface:
            return np.append(x, 0.0)


def by_series(x: NDArray[np.float64]) -> Crossings:
    """Return the crossings in a period, and one later, by the engine."""
    p, found = system().parameter_vector({}), None
    keep = 16
    while found is None or (found.times.size == keep and found.times[-1] < PERIOD):
        keep *= 2
        found = iterate(
            system(), p, x, 0, discard=0, keep=keep, section=EventSection((0, 1), longest=PERIOD), tolerance=(TOL, TOL)
        )
    return Crossings(found.times, found.modes, found.states)


def by_small_steps(x: NDArray[np.float64], mode: int, t: float) -> Crossings:
    """Return the crossings in a time by Runge-Kutta steps."""
    run = EventDrivenMotion(system(), system().parameter_vector({}), x.copy(), mode, TIGHT, TIGHT)
    length = PERIOD / PIECES
    for i in range(1, math.ceil(t / length) + 1):
        run.follow(min(i * length, t), None, None)
    times, which, ends, _ = run.events()
    crossed = which[:, 0] >= 0
    return Crossings(times[crossed], which[crossed, 1], ends[crossed, 0])


def compare(start: int, seed: int) -> tuple[int, Difference | None]:
    """Return how many crossings the reference has in a period, and what differs."""
    x = draw(seed, start)
    found, exact = by_series(x), by_small_steps(x, 0, PERIOD + 2.0 * SAME)
    count = int(np.sum(exact.times < PERIOD))
    at = _first_apart(found.times, exact.times, PERIOD)
    if at is None:
        return count, None
    return count, _missed(start, x, found) or _gathered(start, found, exact, at)


def _first_apart(found: NDArray[np.float64], exact: NDArray[np.float64], end: float) -> int | None:
    """Index of the first crossing before `end` that only one of the two has."""
    for i in range(max(found.size, exact.size)):
        a = found[i] if i < found.size else math.inf
        b = exact[i] if i < exact.size else math.inf
        if min(a, b) >= end:
            return None
        if abs(a - b) > SAME:
            return i
    return None


def _missed(start: int, x: NDArray[np.float64], found: Crossings) -> Difference | None:
    """Return the first crossing that the small steps find from the engine's own state, and it has not, or inversely."""
    begun, mode = 0.0, 0
    for i in range(found.times.size + 1):
        if begun >= PERIOD:
            return None
        end = min(float(found.times[i]) if i < found.times.size else math.inf, PERIOD)
        exact = by_small_steps(x, mode, end - begun + 2.0 * SAME)
        crossing = begun + float(exact.times[0]) if exact.times.size else math.inf
        if crossing < end - SAME:
            return Difference(start, "missed", crossing, _excursion(exact.states[0], 1 - mode))
        if i < found.times.size and end < PERIOD and crossing > end + SAME:
            return Difference(start, "invented", end, _excursion(found.states[i], 1 - mode))
        if i < found.times.size:
            begun, x, mode = float(found.times[i]), found.states[i], 1 - int(found.modes[i])
    return None


def _gathered(start: int, found: Crossings, exact: Crossings, at: int) -> Difference:
    first = min((c for c in (found, exact) if at < c.times.size), key=lambda c: float(c.times[at]))
    return Difference(start, "gathered", float(first.times[at]), _excursion(first.states[at], 1 - int(first.modes[at])))


def _excursion(x: NDArray[np.float64], mode: int) -> float:
    """How far the motion goes from the surface until it is back."""
    back = by_small_steps(x, mode, PERIOD).times
    t_end = float(back[0]) if back.size else PERIOD
    motion = saltus.simulate(
        system(),
        None,
        x,
        mode=system().mode_names[mode],
        t_end=t_end,
        tolerance=(TIGHT, TIGHT),
        options=saltus.options.SimulationOptions(max_events=1),
    )
    surface = system().parameters["a0"] / system().parameters["eta"]
    extremes = observe(motion.motion(), ["min(z)", "max(z)"])
    return max(abs(extremes["min(z)"] - surface), abs(extremes["max(z)"] - surface))


def compared(numbers: list[int], seed: int) -> tuple[int, int, list[Difference]]:
    """Return transients, crossings and differences of some starts."""
    found = [compare(number, seed) for number in numbers]
    return len(found), sum(count for count, _ in found), [difference for _, difference in found if difference]


def results(numbers: range, seed: int, processes: int) -> Iterator[tuple[int, int, list[Difference]]]:
    """Yield the results of chunks of starts as they come."""
    chunks = [list(numbers[i : i + CHUNK]) for i in range(0, len(numbers), CHUNK)]
    work = partial(compared, seed=seed)
    if processes == 1:
        yield from map(work, chunks)
        return
    with multiprocessing.Pool(processes, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        yield from pool.imap_unordered(work, chunks)


def show(done: int, crossings: int, differences: list[Difference], seed: int, seconds: float) -> None:
    """Print counts, and each difference."""
    kinds = Counter(d.kind for d in differences)
    deepest = {kind: max((d.excursion for d in differences if d.kind == kind), default=0.0) for kind in kinds}
    print(f"\n{machine()}")
    print(f"{done} transients of one period, seed {seed}, {crossings} crossings, {seconds:.0f} s")
    for kind, text in (
        ("missed", "missed by the engine"),
        ("invented", "seen by the engine alone"),
        ("gathered", "other by the error gathered before"),
    ):
        print(f"  {text:36} {kinds[kind]:>6}   farthest beyond the surface {deepest.get(kind, 0.0):.2g}")
    deep = sum(1 for d in differences if d.kind == "missed" and d.excursion > DEEP)
    print(f"  {f'missed, and deeper than {DEEP:g}':36} {deep:>6}")
    for d in sorted(differences, key=lambda d: -d.excursion):
        print(f"  start {d.start}: {d.kind} at t = {d.time:.9g}, {d.excursion:.3g} beyond the surface")


def main() -> None:
    """Run the transients that the command line asks for, and print the table."""
    parser = argparse.ArgumentParser(description="Whether the fast engine misses contacts.")
    parser.add_argument("--starts", type=int, default=100_000, help="how many transients (100000)")
    parser.add_argument("--first", type=int, default=0, help="number of the first, to run them in pieces (0)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draws (1)")
    parser.add_argument("--processes", type=int, default=2, help="processes that share them (2)")
    options = parser.parse_args()
    numbers = range(options.first, options.first + options.starts)
    compare(options.first, options.seed)  # compiled before there are processes
    done, crossings, begin = 0, 0, time.perf_counter()
    differences: list[Difference] = []
    try:
        for part, crossed, found in results(numbers, options.seed, options.processes):
            done, crossings, differences = done + part, crossings + crossed, differences + found
            print(f"\r{done} of {len(numbers)} transients, {len(differences)} differ", end="", file=sys.stderr)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
    show(done, crossings, differences, options.seed, time.perf_counter() - begin)


if __name__ == "__main__":
    main()
