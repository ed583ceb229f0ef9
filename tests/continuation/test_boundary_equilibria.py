"""What happens at a boundary equilibrium of a Filippov system: its kind, and the cycle that is born there."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import saltus
from oracles.filippov import SLIDING, Filippov, course
from saltus.errors import InputError
from selection import guarding

RANGE = 0.1  # of the parameter on both sides of the point


class Random:
    """An equilibrium of the field above that meets the surface for eps = 0, in coordinates along and across it.

    Above the field is A x + b eps + q(x, x), below E + B x + g eps.
    """

    def __init__(self, seed: int, n: int = 2, *, units: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.n = n
        while True:
            self.A = self._linear(rng, spirals=seed % 3 != 0)
            self.b, self.E, self.g = (rng.uniform(-size, size, n) for size in (1.0, 1.5, 0.5))
            self.B, self.q = rng.uniform(-0.5, 0.5, (n, n)), rng.uniform(-0.2, 0.2, (n, n, n))
            if seed % 4:  # motions below the surface come back to it
                self.E[1] = abs(self.E[1])
            across = np.linalg.inv(self.A)[1]
            self.weight, self.slope = float(across @ self.E), -float(across @ self.b)
            least = min(abs(self.weight), abs(self.slope), abs(np.linalg.det(self.A)), abs(self.A[1, 0]))
            if least > 0.2 and abs(self.E[1]) > 0.4 and self._room():
                break
        self.units = 10.0 ** rng.choice([-9, 0, 9], units) * np.ones(n)
        self.turn = np.linalg.qr(rng.normal(size=(n, n)))[0]

    def _linear(self, rng: np.random.Generator, *, spirals: bool) -> np.ndarray:
        if not spirals:
            return rng.uniform(-1.5, 1.5, (self.n, self.n))
        grows, turns = rng.uniform(0.05, 0.4), rng.uniform(0.6, 1.5)
        found = -np.diag(rng.uniform(0.5, 1.5, self.n))
        found[:2, :2] = [[grows, turns], [-turns, grows]]
        skew = np.eye(self.n) + rng.uniform(-0.4, 0.4, (self.n, self.n))
        return skew @ found @ np.linalg.inv(skew)

    def _room(self) -> bool:
        """Whether other equilibria are far."""
        places = np.random.default_rng(0).uniform(-1.0, 1.0, (200, self.n)) * 3.0 * RANGE * 2.0
        linear = np.abs(np.linalg.solve(self.A, np.einsum("ijk,pj,pk->ip", self.q, places, places)))
        return bool(linear.max() < 0.5)

    @property
    def kind(self) -> str:
        """Persistence where the pseudo-equilibrium lies on the other side of eps, by the sign of its weight."""
        return "persistence" if self.weight < 0.0 else "nonsmooth fold"

    def rest(self, eps: float) -> np.ndarray:
        """The equilibrium above, in the system's coordinates."""
        x = np.zeros(self.n)
        for _ in range(50):
            x = -np.linalg.solve(self.A, self.b * eps + np.einsum("ijk,j,k->i", self.q, x, x))
        return self.units * (self.turn @ x)

    def system(self) -> saltus.HybridSystem:
        names = ("X", "Y", "Z")[: self.n]
        out, into = self.units[:, None] * self.turn, self.turn.T / self.units

        def field(offset, linear, along, bend):
            moved, shift, gain = out @ linear @ into, out @ offset, out @ along
            bent = np.einsum("ri,ijk,ja,kb->rab", out, bend, into, into)
            texts = []
            for r in range(self.n):
                terms = [f"({float(moved[r, a])!r})*{x}" for a, x in enumerate(names)]
                terms += [
                    f"({float(bent[r, a, b])!r})*{x}*{y}" for a, x in enumerate(names) for b, y in enumerate(names)
                ]
                texts.append(" + ".join([f"({float(shift[r])!r})", f"({float(gain[r])!r})*eps", *terms]))
            return dict(zip(names, texts, strict=True))

        surface = " + ".join(f"({float(c)!r})*{x}" for c, x in zip(into[1], names, strict=True))
        above, below = field(np.zeros(self.n), self.A, self.b, self.q), field(self.E, self.B, self.g, 0.0 * self.q)
        return saltus.filippov(names, {"eps": 0.0}, surface=surface, above=above, below=below)

    def oracle(self, eps: float) -> Filippov:
        """The same in the coordinates along and across, for SciPy."""

        def above(x):
            return self.A @ x + self.b * eps + np.einsum("ijk,j,k->i", self.q, x, x)

        def below(x):
            return self.E + self.B @ x + self.g * eps

        return Filippov(above, below, lambda x: float(x[1]), lambda x: np.eye(self.n)[1])

    def period(self, eps: float) -> float | None:
        """The period of the plane's cycle that slides, by SciPy: it leaves the surface at its tangency, and comes back.

        None where the motion from there leaves the neighbourhood, or meets a pseudo-equilibrium on its way back.
        """
        system, about = self.oracle(eps), -self.b[1] * eps / self.A[1, 0]
        at = brentq(lambda s: system.rates(np.array([s, 0.0]))[0], about - abs(eps), about + abs(eps), xtol=1e-16)

        def met(t, x):
            return x[1] if t > 0.0 else 1.0

        def left(t, x):
            return float(np.abs(x).max()) - 100.0 * abs(eps)

        met.terminal = left.terminal = True
        met.direction = -1
        given = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13 * abs(eps), "max_step": 0.1}
        start = np.array([at, 0.0])
        ahead = start + 1e-4 * system.above(start) + 0.5e-8 * self.A @ system.above(start)
        if ahead[1] <= 0.0:  # an invisible tangency
            return None
        flight = solve_ivp(lambda _, x: system.above(x), (1e-4, 60.0), ahead, events=(met, left), **given)
        if not flight.t_events[0].size:
            return None
        ways = np.linspace(flight.y[0, -1], at, 2000)
        speeds = np.array([system.field(SLIDING, np.array([s, 0.0]))[0] for s in ways]) * np.sign(at - ways[0])
        if system.rates(flight.y[:, -1])[0] > 0.0 or np.any(speeds <= 0.0):
            return None
        slides = quad(lambda s: 1.0 / system.field(SLIDING, np.array([s, 0.0]))[0], ways[0], at, epsrel=1e-10)[0]
        return float(flight.t[-1]) + slides


def boundary(random: Random, system: saltus.HybridSystem):
    end = 0.5 * RANGE * math.copysign(1.0, random.slope)
    start = saltus.find_equilibrium(system, {"eps": end}, x0=random.rest(end), mode="above")
    branch = saltus.continue_equilibrium(start, "eps", (-RANGE, RANGE))
    return next(p for p in branch.special_points if p.type == "BE" and abs(p.parameters["eps"]) < 1e-9)


@pytest.mark.parametrize("seed", guarding(range(100), 5, 6, campaign=12))
def test_boundary_equilibrium_tells_its_kind_in_any_units(seed):
    random = Random(seed, units=2)
    assert boundary(random, random.system()).kind == random.kind


@pytest.mark.parametrize("seed", guarding(range(100), 1, 2, 4, campaign=12))
def test_boundary_equilibrium_gives_the_cycle_born_there(seed):
    random = Random(seed)
    point = boundary(random, random.system())
    assert point.kind == random.kind
    try:
        cycle = saltus.switch_branch(point)
    except InputError:
        assert random.E[1] < 0.0 or {random.period(1e-3), random.period(-1e-3)} == {None}
        return
    eps = cycle.parameters["eps"]
    assert cycle.period == pytest.approx(random.period(eps), rel=1e-6)
    assert random.period(-eps) is None
    assert cycle.stable


@pytest.mark.parametrize("seed", guarding(range(30), 1, 2, campaign=6))
def test_cycle_born_in_three_states_returns_by_scipy(seed):
    random = Random(seed, 3)
    point = boundary(random, random.system())
    assert point.kind == random.kind
    try:
        cycle = saltus.switch_branch(point)
    except InputError:
        return
    eps, first = cycle.parameters["eps"], cycle.signature[0][0]
    x0 = random.turn.T @ (np.array(cycle.x0) / random.units)
    found = course(random.oracle(eps), x0, cycle.period * (1.0 - 1e-9), mode=first, most=4)
    np.testing.assert_allclose(found(cycle.period * (1.0 - 1e-9)), x0, rtol=0.0, atol=1e-5 * abs(eps))
