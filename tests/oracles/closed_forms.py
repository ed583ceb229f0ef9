"""Periodic orbits and bifurcations in closed form; nothing here comes from saltus."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq


def free_motion(k: float, c: float, t: float) -> NDArray[np.float64]:
    """Return the matrix that takes (x, v) of x'' + c x' + k x = 0 over a time `t`; the damping is below critical."""
    w, fade = math.sqrt(k - c * c / 4.0), math.exp(-c * t / 2.0)
    cosine, sine = fade * math.cos(w * t), fade * math.sin(w * t) / w
    return np.array([[cosine + c / 2.0 * sine, sine], [-k * sine, cosine - c / 2.0 * sine]])


@dataclass(frozen=True)
class ImpactOrbit:
    """Orbits of x'' + c x' + k x = A cos s, s' = w, with one impact v := -e v at x = d each m forcing periods.

    Along the branch the speed just before the impact, U, is the natural parameter: the amplitude is a function of it.
    Recipes for Continuation (SIAM 2013), ex. 15.2.
    """

    w: float
    m: int = 1
    k: float = 1.0
    c: float = 0.1
    d: float = 1.0
    e: float = 0.8

    @property
    def period(self) -> float:
        return 2.0 * math.pi * self.m / self.w

    @property
    def impedance(self) -> float:
        return math.hypot(self.k - self.w**2, self.c * self.w)

    @property
    def monodromy_without_impact(self) -> NDArray[np.float64]:
        return expm(np.array([[0.0, 1.0], [-self.k, -self.c]]) * self.period)

    @property
    def _al_be(self) -> tuple[float, float]:
        al, be = np.linalg.solve(self.monodromy_without_impact - np.eye(2), [0.0, 1.0 + self.e])
        return float(al), float(be)

    def amplitude(self, U: float) -> float:
        al, be = self._al_be
        return self.impedance / self.w * math.hypot(self.w * (self.d - al * U), (be + self.e) * U)

    def speeds(self, A: float) -> tuple[float, ...]:
        """Return the speeds U at an amplitude, in growing order: the roots of a quadratic."""
        al, be = self._al_be
        w, d = self.w, self.d
        square = (al * w) ** 2 + (be + self.e) ** 2
        half, rest = al * d * w**2, w**2 * (d**2 - (A / self.impedance) ** 2)
        root = math.sqrt(half**2 - square * rest)
        return (half - root) / square, (half + root) / square

    def after_impact(self, U: float) -> NDArray[np.float64]:
        """Return x, v, s just after the impact, s in (-pi, pi]."""
        F, G = self._F_G(U)
        return np.array([self.d, -self.e * U, math.atan2(G, F)])

    def _F_G(self, U: float) -> tuple[float, float]:
        al, be = self._al_be
        k, c, w, b, dx = self.k, self.c, self.w, be + self.e, self.d - al * U
        return (k - w**2) * dx - c * b * U, (k - w**2) * b * U / w + c * w * dx

    @property
    def det(self) -> float:
        return self.e**2 * math.exp(-self.c * self.period)

    def trace(self, U: float) -> float:
        M = self.monodromy_without_impact
        return -self.e * np.trace(M) + M[0, 1] * (1.0 + self.e) * (self._F_G(U)[0] - self.k * self.d) / U

    def multipliers(self, U: float) -> NDArray[np.complex128]:
        return np.sort_complex(np.roots([1.0, -self.trace(U), self.det]))

    @property
    def A_grazing(self) -> float:
        return self.d * self.impedance

    @property
    def U_fold(self) -> float:
        al, be = self._al_be
        return al * self.w**2 * self.d / ((al * self.w) ** 2 + (be + self.e) ** 2)

    @property
    def U_doubling(self) -> float:
        al, be = self._al_be
        M, k, w = self.monodromy_without_impact, self.k, self.w
        share = M[0, 1] * (1.0 + self.e)
        slope = -(k - w**2) * al - self.c * (be + self.e)
        return share * w**2 * self.d / (1.0 + self.det - self.e * np.trace(M) + share * slope)

    def linear_response(self, A: float) -> tuple[float, NDArray[np.float64]]:
        """Return the greatest x of the motion without impacts, and its state (x, v) at s = 0."""
        z = A / complex(self.k - self.w**2, self.c * self.w)
        return abs(z), np.array([z.real, -self.w * z.imag])


@dataclass(frozen=True)
class TableJump:
    """A ball that jumps once each n periods of a table y = a sin(w t); Gamma = a w^2 / g."""

    e: float
    n: int = 1

    @property
    def fold(self) -> float:
        return self.n * math.pi * (1.0 - self.e) / (1.0 + self.e)

    @property
    def doubling(self) -> float:
        return math.hypot(self.fold, 2.0 * (1.0 + self.e**2) / (1.0 + self.e) ** 2)

    @property
    def det(self) -> float:
        return self.e**2

    def trace(self, Gamma: float, saddle: bool = False) -> float:
        share = math.sqrt(Gamma**2 - self.fold**2)
        return 1.0 + self.e**2 + (1.0 if saddle else -1.0) * (1.0 + self.e) ** 2 * share

    def after_impact(self, Gamma: float, saddle: bool = False) -> NDArray[np.float64]:
        """Return z, v, theta just after the impact, for g = w = 1."""
        theta = math.acos(self.fold / Gamma) * (-1.0 if saddle else 1.0)
        return np.array([Gamma * math.sin(theta), math.pi * self.n, theta])


def two_fields_orbit(al: float, be: float, ga: float, guess: float) -> tuple[float, float, float, float]:
    """Return r0, r1, period and multiplier of problem A: in polar coordinates both fields are integrated by hand.

    Left, r' = (1 - r) r and the angle turns at rate 1; right, dr/dangle = f(r) = al (be - r) r / (ga + be - r). `guess`
    brackets r0 within 10 per cent. The multiplier is the logistic map's slope times f(r0)/f(r1).
    """
    E = math.exp(math.pi)

    def left(r: float) -> float:
        return r * E / (1.0 + r * (E - 1.0))

    def slope(r: float) -> float:
        return al * (be - r) * r / (ga + be - r)

    def angle(r: float) -> float:
        return ((ga + be) / be * math.log(r) - ga / be * math.log(abs(be - r))) / al

    def time(r: float) -> float:
        return math.log(r / abs(be - r)) / (al * be)

    near = 1e-9 * be
    low, high = sorted((0.9 * guess, 1.1 * guess))
    low, high = (max(low, be + near), high) if guess > be else (low, min(high, be - near))
    r0 = brentq(lambda r: angle(r) - angle(left(r)) - math.pi, low, high, xtol=1e-15)
    r1 = left(r0)
    return r0, r1, math.pi + time(r0) - time(r1), E / (1.0 + r0 * (E - 1.0)) ** 2 * slope(r0) / slope(r1)


HENON = {"x": "a - x**2 + b*y", "y": "x"}
LOGISTIC = {"x": "a*x*(1 - x)"}
CUSP = {"x": "r + h*x - x**3"}
DELAYED = {"x": "y", "y": "a*y*(1 - x) - c*(y - x)"}
CIRCLE = {"x": "x + k*(1 - x**2 - p**2)"}
"""Images of maps, as resets of a hybrid system that carries them."""


def henon_fixed_point(a: float, b: float, sign: float = 1.0) -> float:
    return 0.5 * (b - 1.0 + sign * math.sqrt((1.0 - b) ** 2 + 4.0 * a))


def henon_two_cycle(a: float, b: float) -> tuple[float, float]:
    """Return both x of the 2-cycle: their sum is 1 - b, their product (1 - b)^2 - a."""
    root = math.sqrt(4.0 * a - 3.0 * (1.0 - b) ** 2)
    return 0.5 * (1.0 - b - root), 0.5 * (1.0 - b + root)


def logistic_cycle(a: float, period: int, start: float = 0.5) -> list[float]:
    """Return a cycle of the logistic map near the one that iteration from `start` settles on."""
    x = start
    for _ in range(20000):
        x = a * x * (1.0 - x)
    cycle = []
    for _ in range(period):
        cycle.append(x)
        x = a * x * (1.0 - x)
    return cycle
