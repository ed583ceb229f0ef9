"""Multipliers of orbits that meet events slowly are right, or NaN where their own error is of their size."""

from __future__ import annotations

from dataclasses import dataclass

import mpmath
import numpy as np
import pytest

import saltus
from saltus.orbits.stability.speed_errors import errors_by_speeds
from saltus.scales import INFINITE

SPEEDS = [10.0**-k for k in range(1, 13)]


@dataclass(frozen=True)
class Oscillator:
    """An oscillator x'' + 2 z x' + x = cos(w t) before a wall, in units of its own, and one of its orbits."""

    z: float
    w: float
    e: float
    length: float = 1.0
    rate: float = 1.0

    def system(self, wall: float) -> saltus.HybridSystem:
        """Return the system with a wall at some place."""
        field = {"x": "v", "v": "k*k*(a*cos(th) - x) - 2*z*k*v"}
        hit = saltus.Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="hit")
        values = {"a": self.length, "k": self.rate, "z": self.z, "w": self.w * self.rate, "e": self.e, "d": wall}
        return saltus.HybridSystem(("x", "v"), values, {"free": saltus.Mode(field)}, [hit], phase=("th", "w"))

    def settled(self, phase: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf, mpmath.mpf]:
        """Return place, velocity and acceleration of the motion without hits, in units of its own."""
        w = mpmath.mpf(self.w)
        turning = mpmath.exp(1j * phase) / (1 - w * w + 2j * mpmath.mpf(self.z) * w)
        return turning.real, (1j * w * turning).real, (-w * w * turning).real

    def flow(self) -> mpmath.matrix:
        """Return the map of what is free over a period of the drive."""
        A = mpmath.matrix([[0, 1], [-1, -2 * mpmath.mpf(self.z)]])
        return mpmath.expm(A * (2 * mpmath.pi / mpmath.mpf(self.w)))

    def kicked(self) -> mpmath.matrix:
        """Return what is left of the free motion right behind a hit, over the speed of the hit."""
        return (1 + mpmath.mpf(self.e)) * mpmath.lu_solve(mpmath.eye(2) - self.flow(), mpmath.matrix([0, -1]))

    def at_speed(self, speed: float) -> tuple[float, float]:
        """Return the wall and the phase at which an orbit with one hit a period has about that speed."""
        after = self.kicked() * mpmath.mpf(speed)
        phase = mpmath.findroot(lambda s: self.settled(s)[1] + after[1] + mpmath.mpf(self.e) * speed, self.top())
        return float((self.settled(phase)[0] + after[0]) * mpmath.mpf(self.length)), float(phase)

    def top(self) -> mpmath.mpf:
        """Return the phase at which the motion without hits is farthest."""
        w = mpmath.mpf(self.w)
        return mpmath.arg(1 - w * w + 2j * mpmath.mpf(self.z) * w)

    def exact(self, wall: float, phase: float) -> tuple[mpmath.mpf, np.ndarray]:
        """Return the speed of the hit at a wall exactly there, and both multipliers."""
        d, after = mpmath.mpf(wall) / mpmath.mpf(self.length), self.kicked()
        e = mpmath.mpf(self.e)

        def met(phase: mpmath.mpf, speed: mpmath.mpf) -> list[mpmath.mpf]:
            x, v, _ = self.settled(phase)
            return [x + after[0] * speed - d, v + (after[1] + e) * speed]

        phase, speed = mpmath.findroot(met, (mpmath.mpf(phase), -self.settled(mpmath.mpf(phase))[1] / (after[1] + e)))
        # accelerations before the hit and behind it, by the field
        drive = sum(c * part for c, part in zip((1, 2 * mpmath.mpf(self.z), 1), self.settled(phase), strict=True))
        before = drive - d - 2 * mpmath.mpf(self.z) * speed
        behind = drive - d + 2 * mpmath.mpf(self.z) * e * speed
        saltation = mpmath.matrix([[-e, 0], [(behind + e * before) / speed, -e]])
        values = mpmath.eig(self.flow() * saltation, left=False, right=False)
        return speed, np.array(sorted(map(complex, values), key=lambda value: -abs(value)))

    def orbit(self, wall: float, phase: float, speed: float, tolerance: float) -> saltus.PeriodicOrbit:
        """Return the orbit by the package."""
        period = 2.0 * np.pi / (self.w * self.rate)
        start = [wall, -self.e * speed * self.length * self.rate, phase]
        return saltus.solve_orbit(self.system(wall), segments=[("free", "hit", start, period)], tolerance=tolerance)


def drawn(seed: int, **units: float) -> Oscillator:
    """Return a random oscillator."""
    rng = np.random.default_rng([seed, 138])
    return Oscillator(*(float(rng.uniform(*ends)) for ends in ((0.02, 0.3), (0.6, 2.6), (0.1, 0.9))), **units)


def check(one: Oscillator, speed: float, tolerance: float) -> None:
    """Check that multipliers at a speed are right to two digits, unknown where they are not, and as `verify` says."""
    with mpmath.workdps(50):
        wall, phase = one.at_speed(speed)
        met, exact = one.exact(wall, phase)
    orbit = one.orbit(wall, phase, float(met), tolerance)
    told, own = orbit.multipliers, -orbit.states[0, 1] / (one.e * one.length * one.rate)
    if max(abs(exact[0]), abs(told[0])) > INFINITE:  # the event is met without speed: an infinite multiplier is such
        assert abs(exact[0]) > 0.1 * INFINITE
        assert not abs(told[0]) < 0.1 * INFINITE
        return
    off, left = np.abs(told - exact), 100.0 * tolerance  # a multiplier is no smaller than what the flow leaves of 0
    assert not np.any(off > 0.011 * np.abs(exact) + left), (speed, tolerance, told, exact)
    if abs(float(own / met) - 1.0) < 5e-3:  # the orbit's own speed has two digits: so have its multipliers
        assert np.all(np.isfinite(told)), (speed, tolerance, told, exact)
    assert orbit.stable == (abs(exact[0]) < 1.0)
    assert saltus.verify(orbit).passed


@pytest.mark.parametrize(("speed", "tolerance"), [(1e-2, 1e-5), (1e-6, 1e-12), (1e-8, 1e-7), (1e-9, 1e-12)])
def test_multipliers_of_a_slow_impact_are_right_or_unknown(speed, tolerance):
    check(drawn(0), speed, tolerance)


@pytest.mark.campaign
@pytest.mark.parametrize(("length", "rate"), [(1.0, 1.0), (1e-9, 1e9), (1e9, 1e-9), (1e9, 1e9)])
@pytest.mark.parametrize("seed", range(4))
def test_multipliers_of_slow_impacts_are_right_or_unknown_in_any_unit_at_any_tolerance(seed, length, rate):
    for speed in SPEEDS:
        for tolerance in (1e-12, 1e-9, 1e-7, 1e-5):
            check(drawn(seed, length=length, rate=rate), speed, tolerance)


def test_errors_of_multipliers_are_what_the_exact_orbit_says():
    for seed, speed, tolerance in [(1, 1e-6, 1e-12), (2, 1e-8, 1e-12), (4, 1e-10, 1e-12), (1, 1e-3, 1e-5)]:
        one = drawn(seed)
        with mpmath.workdps(50):
            wall, phase = one.at_speed(speed)
            met, exact = one.exact(wall, phase)
        orbit = one.orbit(wall, phase, float(met), tolerance)
        problem, u = orbit.problem(), np.array(orbit.unknowns)
        problem.resolve(u)
        problem.survey(u)
        errors = errors_by_speeds(problem, u, orbit.multipliers, [0])
        true = np.abs(orbit.multipliers - exact)
        assert np.all(true < 2.0 * errors), (seed, speed, true, errors)
        assert true[0] > 0.01 * errors[0], (seed, speed, true, errors)
