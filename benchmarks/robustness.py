"""How often a branch from a random start ends well, and whether half the step finds the same special points.

`robustness.py systems` makes public calls on random hybrid systems instead, and compares with SciPy:
`random_systems` draws them, `random_calls` makes the calls, `random_watch` stops what takes too long.

Orbits of the tapping-mode AFM with one or two modes, at random parameters and from random states, are continued in a
random parameter over its interval, twice: by the default steps and by steps at most half as long. A branch ends well at
a bound, closed, at chatter, or where the period halves. Where two modes meet a surface without velocity, both damping
laws may bend the motion away from it; then no orbit lies beyond, and such ends are listed.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np
from measure import machine
from random_calls import CALLS
from random_watch import run as run_systems

import saltus
from saltus import afm
from saltus.continuation import StepControl

INTERVALS = {"Omega": (0.85, 1.5), "ybar": (0.05, 0.14), "D_att": (0.01, 0.06), "D_rep": (0.5, 30.0)}
"""Where the parameters are drawn and continued: evenly, but `D_rep` evenly in its logarithm."""

SAME = 1e-7
"""Largest difference of a special point's parameter between the two step sizes."""

GOOD = ("bound reached", "the branch is closed", "chatter", "the period halves")
"""Ends of a branch that nothing is wrong with, by what their sentences hold."""

NOWHERE = "does not turn back"
"""The same for a grazing beyond which there is no orbit."""


@dataclass(frozen=True)
class Outcome:
    """What came of one start.

    Attributes
    ----------
    start : int
        Its number; with the seed it gives the same start again.
    about : str
        Modes, parameter that varies, parameters, orbit.
    redrawn : int
        How many draws before it led to no periodic orbit.
    ends : tuple of str
        Why each direction ended, by the default steps.
    points, special : int
        Orbits on the branch; special points.
    trouble : tuple of str
        Ends that are not good, differences between the two step sizes, an exception.
    seconds : float
        Of both branches.
    """

    start: int
    about: str
    redrawn: int
    ends: tuple[str, ...] = ()
    points: int = 0
    special: int = 0
    trouble: tuple[str, ...] = ()
    seconds: float = 0.0


@dataclass
class Table:
    """Outcomes so far."""

    outcomes: list[Outcome] = field(default_factory=list)

    def show(self, asked: int, seed: int, seconds: float) -> None:
        """Print counts by reason of ending, and each start in trouble."""
        done = sorted(self.outcomes, key=lambda o: o.start)
        times = sorted(o.seconds for o in done)
        bad = [o for o in done if o.trouble]
        nowhere = [o for o in done if not o.trouble and any(NOWHERE in end for end in o.ends)]
        print(f"\n{machine()}")
        print(f"{len(done)} of {asked} starts, seed {seed}, {seconds:.0f} s")
        for text, value in (
            ("draws without a periodic orbit, drawn again", sum(o.redrawn for o in done)),
            ("orbits on the branches", sum(o.points for o in done)),
            ("special points on them", sum(o.special for o in done)),
            ("seconds for a start's two branches, median", f"{times[len(times) // 2]:.2f}" if times else "-"),
            ("the same, longest", f"{times[-1]:.1f}" if times else "-"),
            ("branches that end well, the same by half the step", len(done) - len(bad) - len(nowhere)),
            ("the same, but for a grazing beyond which there is no orbit", len(nowhere)),
            ("branches in trouble", len(bad)),
        ):
            print(f"  {text:58}  {value:>6}")
        print("ends, two to a branch")
        for reason, count in Counter(_reason(end) for o in done for end in o.ends).most_common():
            print(f"  {count:5d}  {reason}")
        for title, listed in (("no orbit beyond a grazing", nowhere), ("in trouble", bad)):
            for o in listed:
                print(f"{title}, start {o.start}: {o.about}")
                for line in o.trouble or [end for end in o.ends if NOWHERE in end]:
                    print(f"    {line}")


@lru_cache(maxsize=2)
def system(modes: int) -> saltus.HybridSystem:
    """The tapping-mode AFM with one mode or two."""
    return afm.tapping_mode(afm.table1(), modes=modes)


def draw(seed: int, start: int) -> tuple[saltus.results.PeriodicOrbit, str, tuple[float, float], int]:
    """Return an orbit, the parameter to be continued, its interval, and how many draws led to none."""
    rng = np.random.default_rng((seed, start))
    modes = int(rng.integers(1, 3))
    for redrawn in range(1000):
        parameters = {name: float(rng.uniform(*INTERVALS[name])) for name in ("Omega", "ybar")}
        for i in range(1, modes + 1):
            parameters[f"D_att_{i}"] = float(rng.uniform(*INTERVALS["D_att"]))
            parameters[f"D_rep_{i}"] = math.exp(rng.uniform(*np.log(INTERVALS["D_rep"])))
        # small motions settle on the attractive orbit where there are two, large ones on the repulsive
        size, angle = rng.uniform(0.0, 1.2), rng.uniform(0.0, 2.0 * math.pi)
        x0 = np.zeros(2 * modes)
        x0[0], x0[modes] = min(size * math.cos(angle), 0.9), size * math.sin(angle)
        name = str(rng.choice(list(parameters)))
        try:
            orbit = saltus.find_orbit(system(modes), parameters, x0)
        except saltus.SaltusError:
            continue
        return orbit, name, INTERVALS[name[:5] if name[0] == "D" else name], redrawn
    raise RuntimeError(f"no periodic orbit at start {start}")


def examine(start: int, seed: int) -> Outcome:
    """Return what comes of one start."""
    orbit, name, bounds, redrawn = draw(seed, start)
    values = ", ".join(
        f"{key} = {orbit.parameters[key]:.6g}" for key in orbit.parameters if key[:2] in ("Om", "yb", "D_")
    )
    modes = len(orbit.system.states) // 2
    about = f"{modes} modes, {name} varies; {values}; {len(orbit.form)} segments, {orbit.form.turns} turns"
    begin = time.perf_counter()
    try:
        branch = saltus.continue_orbit(orbit, name, bounds)
        again = saltus.continue_orbit(orbit, name, bounds, steps=StepControl(largest=0.5 * StepControl().largest))
    except Exception:
        return Outcome(start, about, redrawn, trouble=tuple(traceback.format_exc().splitlines()[-4:]))
    if "interrupted" in (*branch.stopped, *again.stopped):
        raise KeyboardInterrupt
    trouble = [f"ends: {end}" for end in branch.stopped if not any(good in end for good in (*GOOD, NOWHERE))]
    trouble += differences(branch, again)
    return Outcome(
        start, about, redrawn, branch.stopped, len(branch), len(branch.special_points), tuple(trouble),
        time.perf_counter() - begin,
    )  # fmt: skip


def differences(a: saltus.results.Branch, b: saltus.results.Branch) -> list[str]:
    """Return in words how the special points and ends of two branches differ."""
    found = []
    if [_reason(end) for end in a.stopped] != [_reason(end) for end in b.stopped]:
        found.append(f"other ends by half the step: {a.stopped}, {b.stopped}")
    for kind in sorted({p.type for branch in (a, b) for p in branch.special_points}):
        one, other = (
            sorted(p.parameters[a.parameter] for p in branch.special_points if p.type == kind) for branch in (a, b)
        )
        if len(one) != len(other):
            found.append(f"{kind}: {len(one)} points, {len(other)} by half the step: {_listed(one)}; {_listed(other)}")
        elif (apart := max(abs(x - y) for x, y in zip(one, other, strict=True))) > SAME:
            found.append(f"{kind}: apart by {apart:.2g}: {_listed(one)}; {_listed(other)}")
    return found


def _listed(values: list[float]) -> str:
    return ", ".join(f"{value:.10g}" for value in values)


def _reason(end: str) -> str:
    return end.split(": ", 1)[-1]


def outcomes(starts: range, seed: int, processes: int) -> Iterator[Outcome]:
    """Yield outcomes as they come."""
    work = partial(examine, seed=seed)
    if processes == 1:
        yield from map(work, starts)
        return
    with multiprocessing.Pool(processes, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        yield from pool.imap_unordered(work, starts)


def main() -> None:
    """Run the starts that the command line asks for, and print the table."""
    parser = argparse.ArgumentParser(description="How branches from random starts, or calls on random systems, end.")
    parser.add_argument("what", nargs="?", choices=("afm", "systems"), default="afm", help="what is drawn (afm)")
    parser.add_argument("--starts", "--count", type=int, default=200, help="how many starts, or systems (200)")
    parser.add_argument("--first", type=int, default=0, help="number of the first, to run them in pieces (0)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draws (1)")
    parser.add_argument("--processes", type=int, default=2, help="processes that share the work (2)")
    parser.add_argument(
        "--calls",
        nargs="+",
        choices=CALLS,
        default=CALLS,
        help="which calls on systems (all)",
    )
    options = parser.parse_args()
    starts = range(options.first, options.first + options.starts)
    if options.what == "systems":
        run_systems(starts, options.seed, options.processes, tuple(options.calls))
        return
    table, begin = Table(), time.perf_counter()
    try:
        for outcome in outcomes(starts, options.seed, options.processes):
            table.outcomes.append(outcome)
            bad = sum(1 for o in table.outcomes if o.trouble)
            print(f"\r{len(table.outcomes)} of {len(starts)} starts, {bad} in trouble", end="", file=sys.stderr)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
    table.show(len(starts), options.seed, time.perf_counter() - begin)


if __name__ == "__main__":
    main()
