"""The paper's tapping cantilever from its Table 1 up, and its map by SciPy's DOP853; nothing comes from saltus."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

LENGTH, WIDTH, THICKNESS, YOUNG = 240e-6, 64e-6, 2.1e-6, 176e9
RADIUS, HAMAKER, E_STAR, A0, ETA = 20e-9, 2.96e-19, 10.4e9, 2e-10, 60e-9


def _root(i: int) -> float:
    return brentq(lambda b: math.cos(b) + 1.0 / math.cosh(b), (i - 0.9) * math.pi, i * math.pi, xtol=1e-15)


def _drive(b: float) -> float:
    sigma = (math.cosh(b) + math.cos(b)) / (math.sinh(b) + math.sin(b))

    def phi(x: float) -> float:
        return math.cosh(b * x) - math.cos(b * x) - sigma * (math.sinh(b * x) - math.sin(b * x))

    area = quad(phi, 0.0, 1.0, epsabs=1e-14)[0]
    return phi(1.0) * area / quad(lambda x: phi(x) ** 2, 0.0, 1.0, epsabs=1e-14)[0]


@dataclass(frozen=True)
class Tapping:
    """Equations (12) of the paper with consistent static term; states q1..qn, v1..vn."""

    n: int
    Omega: float
    ybar: float = 0.108
    D_att: float = 0.025
    D_rep: float = 4.0

    def __post_init__(self) -> None:
        roots = [_root(i) for i in range(1, self.n + 1)]
        k = roots[0] ** 4 * YOUNG * WIDTH * THICKNESS**3 / 12.0 / (4.0 * LENGTH**3)
        object.__setattr__(self, "K", np.array([(b / roots[0]) ** 4 for b in roots]))
        object.__setattr__(self, "B", np.array([_drive(b) for b in roots]))
        object.__setattr__(self, "C", -HAMAKER * RADIUS / (6.0 * k * ETA**3))
        object.__setattr__(self, "G", 4.0 / 3.0 * E_STAR * math.sqrt(RADIUS * ETA) / k)
        object.__setattr__(self, "a0", A0 / ETA)

    def gap(self, t: float, x: NDArray[np.float64]) -> float:
        return 1.0 - float(x[: self.n].sum()) - self.ybar * math.sin(self.Omega * t)

    def field(self, mode: int, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        q, v, z = x[: self.n], x[self.n :], self.gap(t, x)
        if mode:
            force, damping = self.C / self.a0**2 + self.G * max(self.a0 - z, 0.0) ** 1.5, self.D_rep
        else:
            force, damping = self.C / z**2, self.D_att
        drive = self.B * self.Omega**2 * self.ybar * math.sin(self.Omega * t)
        return np.concatenate([v, -damping * v - self.K * q + self.C - force + drive])

    def gap_rate(self, t: float, x: NDArray[np.float64]) -> float:
        return -float(x[self.n :].sum()) - self.ybar * self.Omega * math.cos(self.Omega * t)

    def map(
        self, x: NDArray[np.float64], rtol: float = 1e-12
    ) -> tuple[NDArray[np.float64], list[tuple[float, NDArray[np.float64]]]]:
        """Return the state one forcing period later, from phase 0 in flight, and the crossings (time, state)."""
        t, end, mode, crossings = 0.0, 2.0 * math.pi / self.Omega, 0, []
        while t < end:

            def surface(t: float, x: NDArray[np.float64]) -> float:
                return self.gap(t, x) - self.a0

            surface.terminal = True  # type: ignore[attr-defined]
            surface.direction = 1.0 if mode else -1.0  # type: ignore[attr-defined]
            flown = solve_ivp(
                lambda t, x, mode=mode: self.field(mode, t, x),
                (t, end),
                x,
                "DOP853",
                rtol=rtol,
                atol=rtol * 1e-2,
                events=surface,
            )
            t, x = float(flown.t[-1]), flown.y[:, -1]
            if flown.status == 1:
                crossings.append((t, x))
                mode = 1 - mode
        return x, crossings


def central_jacobian(image, x: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Return the Jacobian of a map by central differences of fourth order."""
    columns = []
    for i in range(x.size):
        d = np.zeros(x.size)
        d[i] = step
        columns.append((8.0 * (image(x + d) - image(x - d)) - (image(x + 2 * d) - image(x - 2 * d))) / (12.0 * step))
    return np.array(columns).T
