"""What public calls make of a random hybrid system: how each ends, and whether SciPy agrees."""

from __future__ import annotations

import math
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from random_systems import Drawn, Motion, Reference

import saltus

SAME = 1e-6  # agreement of a motion with SciPy's, relative to 1 or to the states' sizes
NUDGE = 1e-10  # displacement of a start that tells how well conditioned its motion is
GROWN = 1e-8  # where the nudge has grown beyond this, a motion is not compared
ACCUMULATE = 5  # events in a row, each sooner than the last, that may go on without end
KNOWN = 1e-9  # size of a multiplier beside sensitivities of size 1, below which it is their error
PLACES = 41  # times at which motions are compared

CALLS = ("simulate", "find_orbit", "continue_orbit", "run_sweep", "lyapunov_spectrum")


@dataclass(frozen=True)
class Ending:
    """How one call ended.

    Attributes
    ----------
    number : int
        The system.
    about : str
        The system in words.
    call : str
        The function.
    kind : str
        "result", the name of a `SaltusError`, "skipped", or what is wrong: "stray NAME", "long message", "slow",
        "memory", "crash"; "no check" where SciPy takes too long.
    text : str
        Message, or place.
    seconds, mib : float
        Processor time; memory added at its highest.
    checks : tuple of (str, str)
        Name of each check, and "" or what it found.
    """

    number: int
    about: str
    call: str
    kind: str
    text: str = ""
    seconds: float = 0.0
    mib: float = 0.0
    checks: tuple[tuple[str, str], ...] = ()


class Work:
    """The calls on one system, each with its checks."""

    def __init__(self, drawn: Drawn, tell: Callable[[bool], None]) -> None:
        self.drawn, self.tell, self.seconds = drawn, tell, 0.0
        self.system = saltus.HybridSystem.from_definition(drawn.definition)
        self.forced = drawn.definition["phase"] is not None
        self.options: dict[str, Any] = {} if drawn.mode is None else {"mode": drawn.mode}
        self.orbit: saltus.results.PeriodicOrbit | None = None

    def ask(self, function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """Return what a function of saltus returns; tell that it is at work, and count its processor time."""
        self.tell(True)
        begin = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "saltus: .* lands beyond")
                return function(*arguments, **options)
        finally:
            self.seconds += time.process_time() - begin
            self.tell(False)

    def simulate(self) -> tuple[str, list[tuple[str, str]]]:
        """Compare a motion with SciPy's over the stretch on which both are well conditioned."""
        drawn, checks = self.drawn, []
        truth, until = self._truth()
        try:
            path = self.ask(saltus.simulate, self.system, {}, drawn.x0, t_end=drawn.span, **self.options)
        except (saltus.errors.ChatteringError, saltus.errors.DivergenceError) as error:
            if truth is not None:
                checks.append(("early end", self._early_end(error, truth, until)))
                if 0.9 * error.args[0] > 0.0:
                    path = self.ask(
                        saltus.simulate, self.system, {}, drawn.x0, t_end=0.9 * error.args[0], **self.options
                    )
                    checks.append(("motion", self._compare(path, truth, min(until, path.t_end))))
            raise Told(error, checks) from error
        except saltus.InputError as error:
            if truth is not None:
                checks.append(("start", f"refused, though {truth.mode!r} allows it"))
            raise Told(error, checks) from error
        if truth is None:
            return "", [("start", "no mode allows it, and it was taken")]
        checks.append(("motion", self._compare(path, truth, until)))
        return f"{len(path.events)} events", checks

    def _truth(self) -> tuple[Motion | None, float]:
        """Return SciPy's motion, and until when it is well conditioned; None where no mode allows the start."""
        drawn, reference = self.drawn, Reference(self.drawn.definition, {})
        x0 = np.array([*drawn.x0, *([0.0] if self.forced else [])])
        mode = drawn.mode or reference.starting_mode(x0)
        if mode is None:
            return None, 0.0
        times = np.linspace(0.0, drawn.span, PLACES)
        truth = reference.run(x0, mode, drawn.span, times)
        until = drawn.span
        for sign in (1.0, -1.0):
            direction = np.random.default_rng(drawn.number).normal(size=x0.size)
            direction[-1] *= 0.0 if self.forced else 1.0
            near = reference.run(x0 + sign * NUDGE * direction / np.linalg.norm(direction), mode, drawn.span, times)
            apart = np.max(np.abs(near.states - truth.states), axis=1) / _size(truth.states)
            close = apart < GROWN
            for (t, name), (s, other) in zip(truth.events, near.events, strict=False):
                if name != other or abs(t - s) > GROWN:
                    until = min(until, 0.999 * min(t, s))
                    break
            if len(near.events) != len(truth.events):
                longer = max(near.events, truth.events, key=len)
                until = min(until, 0.999 * longer[min(len(near.events), len(truth.events))][0])
            until = min(until, _accumulation(truth.events))
            bad = times[~close & ~_near_events(times, truth, 1e-6)]
            until = min(until, float(bad[0]) * 0.999 if bad.size else until)
        return truth, until

    def _compare(self, path: saltus.results.Trajectory, truth: Motion, until: float) -> str:
        """Return in words how a motion differs from SciPy's up to a time."""
        times = np.linspace(0.0, self.drawn.span, PLACES)
        ours = [(float(e["time"]), str(e["name"])) for e in path.events if e["kind"] == "event"]
        for (t, name), (s, other) in zip(ours, truth.events, strict=False):
            if min(t, s) >= until:
                break
            if name != other or abs(t - s) > SAME:
                return f"{name} at {t:.9g} where SciPy has {other} at {s:.9g}"
        shorter = min(len(ours), len(truth.events))
        for who, more in (("only here", ours[shorter:]), ("only SciPy", truth.events[shorter:])):
            if more and more[0][0] < until * (1.0 - 1e-6):
                return f"{who}: {more[0][1]} at {more[0][0]:.9g}"
        inside = times[(times <= until) & ~_near_events(times, truth, 1e-6)]
        inside = inside[inside <= min(path.t_end, truth.time)]
        if not inside.size:
            return "too short to compare"
        found = path(inside)
        wanted = truth.states[np.searchsorted(times, inside)]
        if self.forced:
            found, wanted = found[:, :-1], wanted[:, :-1]
        apart = np.max(np.abs(found - wanted), axis=1) / _size(wanted)
        worst = int(np.argmax(apart))
        if not apart[worst] < SAME:
            return f"apart by {apart[worst]:.2g} at t = {inside[worst]:.6g}"
        return "" if inside[-1] > 0.0 else "too short to compare"

    def _early_end(self, error: Exception, truth: Motion, until: float) -> str:
        if until < min(error.args[0], truth.time):
            return "too short to compare"
        t, told = float(error.args[0]), type(error).__name__
        kind = {"chatter": "ChatteringError", "diverged": "DivergenceError", "": "no error"}[truth.ended]
        # SciPy's motion counts as divergent at a nearer bound, and as chattering a little later
        if kind == told and (
            abs(t - truth.time) < 1e-3 * max(1.0, t) or (truth.ended == "diverged" and t > truth.time)
        ):
            return ""
        return f"{told} at t = {t:.9g} where SciPy has {kind} at {truth.time:.9g}, after {len(truth.events)} events"

    def find_orbit(self) -> tuple[str, list[tuple[str, str]]]:
        """Check that SciPy's motion from the orbit closes, once round, and its multipliers."""
        self.orbit = self.ask(saltus.find_orbit, self.system, {}, self.drawn.x0, settle=400, **self.options)
        return _orbit_line(self.orbit), self._orbit_checks(self.orbit, minimal=True)

    def _orbit_checks(self, orbit: saltus.results.PeriodicOrbit, *, minimal: bool = False) -> list[tuple[str, str]]:
        """Return what SciPy says of an orbit: its motion from the middle of the first segment for a period."""
        reference = Reference(self.drawn.definition, dict(orbit.parameters))
        segment, period = orbit.segments[0], orbit.period
        fired = orbit.segments[-1].transition
        begin = reference.run(segment.state, segment.mode, 0.5 * segment.duration, fired=fired)
        if begin.events or begin.ended:
            return [("orbit closes", f"no motion for half of its first segment: {begin.events[:1]} {begin.ended}")]
        n, x = len(self.drawn.x0), begin.x
        parts = np.linspace(0.0, period, 61)[1:-1]
        once = reference.run(x, segment.mode, period, parts)
        size = _size(np.vstack([x[:n], once.states[:, :n]]))[0]
        told = [s.transition for s in orbit.segments if s.transition in self.system.transition_names]
        gap = float(np.max(np.abs(once.x[:n] - x[:n]))) / size
        matrix = self._monodromy(reference, x, segment.mode, period, [name for _, name in once.events], size)
        growth = float(np.max(np.abs(matrix))) if matrix is not None else math.inf
        if not growth < 1e4:
            return [("orbit closes", "too short to compare")]
        checks = [("orbit closes", "")]
        if [name for _, name in once.events] != told and orbit.admissible:
            checks = [("orbit closes", f"events {[name for _, name in once.events]} where it has {told}")]
        elif not gap < SAME and orbit.admissible:
            checks = [("orbit closes", f"gap {gap:.2g} after its period of {period:.9g}")]
        elif not orbit.admissible:
            checks = [
                ("orbit closes", "" if gap > SAME or not minimal else f"closes, and is not admissible: {orbit.reasons}")
            ]
            return checks
        if minimal:
            whole = once.states[:, :n]
            fractions = [k for k in range(2, 8) if not self.forced or orbit.form.turns % k == 0]
            short = [
                k
                for k in fractions
                if np.max(np.abs(reference.run(x, segment.mode, period / k).x[:n] - x[:n])) < 1e-6 * size
            ]
            wide = float(np.max(np.ptp(whole, axis=0)))
            checks.append(("once round", f"{short[0]} times round" if short and wide > 1e-6 else ""))
        eigenvalues = np.linalg.eigvals(matrix)
        apart = _pairing(eigenvalues, orbit.multipliers)
        checks.append(
            (
                "multipliers",
                ""
                if apart < 1e-3 * max(1.0, growth)
                else f"apart by {apart:.2g}: {_short(orbit.multipliers)}, SciPy {_short(eigenvalues)}",
            )
        )
        return checks

    def _monodromy(
        self, reference: Reference, x: np.ndarray, mode: str, period: float, events: list[str], size: float
    ) -> np.ndarray | None:
        """Return the derivative of SciPy's motion over a period by central differences.

        None where events differ, or where half the step gives another derivative, as it does next to a grazing.
        """
        n, found = len(self.drawn.x0), []
        for step in (1e-5 * size, 5e-6 * size):
            columns = []
            for i in range(n):
                ends = []
                for sign in (1.0, -1.0):
                    start = x.copy()
                    start[i] += sign * step
                    motion = reference.run(start, mode, period)
                    if [name for _, name in motion.events] != events or motion.ended:
                        return None
                    ends.append(motion.x[:n])
                columns.append((ends[0] - ends[1]) / (2.0 * step))
            found.append(np.array(columns).T)
        return found[1] if np.max(np.abs(found[1] - found[0])) < 1e-5 * max(1.0, np.max(np.abs(found[1]))) else None

    def continue_orbit(self) -> tuple[str, list[tuple[str, str]]]:
        """Continue the orbit found and check special points and some others by SciPy."""
        if self.orbit is None:
            raise Skipped
        mu = self.orbit.parameters["mu"]
        control = saltus.StepControl(max_points=150)
        branch = self.ask(saltus.continue_orbit, self.orbit, "mu", (mu - 0.2, mu + 0.2), steps=control)
        checks = []
        # at a grazing whose reset moves the state one multiplier is infinite
        if not np.all(np.isfinite(branch.values)) or np.any(np.isnan(branch.multipliers)):
            checks.append(("finite", "a value on the branch is not, or a multiplier is no number"))
        located = branch.special_points.of_type("SN", "PD", "TR")[:4]
        checks += [(point.type, self._special(point)) for point in located]
        rng = np.random.default_rng(self.drawn.number)
        for i in rng.choice(len(branch), min(3, len(branch)), replace=False):
            orbit = branch.solution(int(i))
            if orbit.admissible:
                found = self._orbit_checks(orbit)
                checks += [
                    (f"branch: {name}", text and f"at mu = {orbit.parameters['mu']:.9g}: {text}")
                    for name, text in found
                ]
        kinds = Counter(p.type for p in branch.special_points)
        return f"{len(branch)} points, {dict(kinds)}, {branch.stopped}", checks

    def _special(self, point: saltus.results.SpecialPoint) -> str:
        """Return what is wrong with a bifurcation by SciPy's multipliers."""
        orbit = point.orbit
        reference = Reference(self.drawn.definition, dict(orbit.parameters))
        segment = orbit.segments[0]
        begin = reference.run(segment.state, segment.mode, 0.5 * segment.duration, fired=orbit.segments[-1].transition)
        once = reference.run(begin.x, segment.mode, orbit.period)
        size = float(np.max(np.abs(orbit.states)))
        matrix = self._monodromy(reference, begin.x, begin.mode, orbit.period, [n for _, n in once.events], size)
        if matrix is None or not np.max(np.abs(matrix)) < 1e4:
            return "too short to compare"
        eigenvalues = np.linalg.eigvals(matrix)
        if not self.forced:
            eigenvalues = np.delete(eigenvalues, np.argmin(np.abs(eigenvalues - 1.0)))
        if point.type == "TR":
            bent = eigenvalues[np.abs(eigenvalues.imag) > 1e-6]
            away = float(np.min(np.abs(np.abs(bent) - 1.0))) if bent.size else math.inf
        else:
            away = float(np.min(np.abs(eigenvalues - (1.0 if point.type == "SN" else -1.0))))
        # at a fold of an autonomous orbit 1 is a double eigenvalue, which moves with the root of an error
        allowed = 3e-2 if point.type == "SN" and not self.forced else 1e-3
        return (
            ""
            if away < allowed
            else f"at mu = {point.parameters['mu']:.9g}: SciPy's nearest multiplier is {away:.2g} away"
        )

    def run_sweep(self) -> tuple[str, list[tuple[str, str]]]:
        """Sweep mu over three values; a value without a reason must have finite points."""
        mu = self.drawn.definition["parameters"]["mu"]
        passed = [name for _, name in self.orbit.signature if name] if self.orbit is not None else []
        section = None if self.forced else next(iter(passed), saltus.Section(f"{self.system.states[0]} - 0.1", 1))
        sweep = self.ask(
            saltus.run_sweep,
            self.system, "mu", [mu - 0.05, mu, mu + 0.05], x0=self.drawn.x0,
            options=saltus.options.SweepOptions(discard=50, keep=20, section=section, workers=1, **self.options),
        )  # fmt: skip
        labels = sweep.labels[0].tolist()
        bare = [
            label
            for label, reason, points in zip(labels, sweep.reasons[0], sweep.points[0], strict=True)
            if not reason and label not in ("", "no return") and not np.all(np.isfinite(points))
        ]
        return ", ".join(labels), [("finite points", f"none at a value labelled {bare[0]}" if bare else "")]

    def lyapunov_spectrum(self) -> tuple[str, list[tuple[str, str]]]:
        """Compare the exponents with the multipliers of the orbit found."""
        average = saltus.Average(periods=60) if self.forced else saltus.Average(t_end=200.0)
        spectrum = self.ask(saltus.lyapunov_spectrum, self.system, {}, self.drawn.x0, average=average, **self.options)
        found = np.array(spectrum.exponents)
        checks = [("finite", "" if np.all(np.isfinite(found)) else f"exponents {found}")]
        if self.orbit is not None:
            with np.errstate(divide="ignore"):
                wanted = np.sort(np.log(np.abs(self.orbit.multipliers)) / self.orbit.period)[::-1]
            both = wanted > max(-3.0, math.log(KNOWN) / self.orbit.period)
            apart = np.abs(found - wanted)[both]
            checks.append(
                ("exponents", "" if not apart.size or apart.max() < 0.1 else f"{found}, by the multipliers {wanted}")
            )
        return str(found.round(4).tolist()), checks


class Told(Exception):
    """An error that saltus raised on purpose, with the checks made of it."""

    def __init__(self, error: Exception, checks: list[tuple[str, str]]) -> None:
        super().__init__(str(error))
        self.error, self.checks = error, checks


class Skipped(Exception):
    """There is nothing to call the function with."""


def _near_events(times: np.ndarray, motion: Motion, close: float) -> np.ndarray:
    if not motion.events:
        return np.zeros(times.shape, dtype=bool)
    at = np.array([t for t, _ in motion.events])
    return np.asarray(np.min(np.abs(times[:, None] - at[None, :]), axis=1) < close)


def _accumulation(events: list[tuple[float, str]]) -> float:
    """Return when events may begin to accumulate; infinity where they do not.

    Where they do, a motion may end, or pass through the limit of infinitely many events: rounding decides when.
    """
    run = 0
    for (a, _), (b, _), (c, _) in zip(events, events[1:], events[2:], strict=False):
        run = run + 1 if 0.0 <= c - b < b - a else 0
        if run >= ACCUMULATE:
            return a
    return math.inf


def _size(states: np.ndarray) -> np.ndarray:
    return np.maximum(1.0, np.max(np.abs(states), axis=-1))


def _pairing(a: np.ndarray, b: np.ndarray) -> float:
    """Return the largest distance between two sets of numbers, each of `a` paired with the nearest left of `b`."""
    left, worst = list(b), 0.0
    for value in sorted(a, key=abs, reverse=True):
        nearest = min(left, key=lambda other: abs(other - value))
        left.remove(nearest)
        worst = max(worst, abs(nearest - value))
    return worst


def _short(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{v:.5g}" for v in values) + "]"


def _orbit_line(orbit: saltus.results.PeriodicOrbit) -> str:
    return f"T = {orbit.period:.6g}, {len(orbit.form)} segments, {orbit.form.turns} turns"


def ending_of(work: Work, call: str) -> Ending:
    """Make one call and return how it ended."""
    function: Callable[[], tuple[str, list[tuple[str, str]]]] = getattr(work, call)
    work.seconds, checks = 0.0, []
    try:
        text, checks = function()
        kind = "result"
    except Skipped:
        kind, text = "skipped", "no orbit"
    except Told as told:
        (kind, text), checks = _error(told.error), told.checks
    except saltus.SaltusError as error:
        kind, text = _error(error)
    except MemoryError:
        kind, text = "memory", "MemoryError"
    except Exception as error:
        kind, text = f"stray {type(error).__name__}", " | ".join(traceback.format_exc().splitlines()[-3:])
    return Ending(work.drawn.number, str(work.drawn), call, kind, text, work.seconds, 0.0, tuple(checks))


def _error(error: Exception) -> tuple[str, str]:
    text = str(error)
    fine = "\n" not in text and 0 < len(text) < 500
    return (type(error).__name__ if fine else "long message"), text[:300]
