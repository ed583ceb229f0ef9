"""A sliding equilibrium goes through a two-fold, where its field is 0/0, and the branch tells it once."""

import numpy as np
import pytest
from scipy.optimize import brentq

import saltus
from selection import guarding

RANGE = 0.1  # of the parameter on both sides of the two-fold


class Random:
    """Fields beside a surface that are tangent to it at one place, for eps = 0: a pseudo-equilibrium lies there.

    In coordinates along (x) and across (y) the surface, and one more (z) where there are three, the pseudo-equilibria
    are the zeros of a function of x: fields antiparallel on y = 0.
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.n = 3 if seed % 3 == 0 else 2
        self.p = self._draw(rng)
        while not self._regular():
            self.p = self._draw(rng)
        self.units = 10.0 ** rng.choice([-9, 0, 9], self.n) if seed % 2 else np.ones(self.n)
        self.turn = np.linalg.qr(rng.normal(size=(self.n, self.n)))[0]

    @staticmethod
    def _draw(rng: np.random.Generator) -> list[list[float]]:
        return [
            [rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.5), *rng.uniform(-0.3, 0.3, 3),
             rng.choice([-1, 1]) * rng.uniform(0.5, 1.5), rng.uniform(-1, 1), *rng.uniform(-0.3, 0.3, 2),
             rng.uniform(-1, 1), *rng.uniform(-0.3, 0.3, 2), -rng.uniform(0.5, 1.5)]
            for _ in range(2)
        ]  # fmt: skip

    def _regular(self) -> bool:
        """Whether the branch has no fold nearby, and the fields agree nowhere on it, which ends it."""
        (a, _, _, _, k, e, *_), (b, _, _, _, m, f, *_) = self.p
        bend = k * b - m * a
        along = (f * a - e * b) / bend if bend else np.inf
        return abs(bend) > 0.5 and abs(along) < 2.0 and abs((m - k) * along + f - e) > 0.5

    def rates(self, k: int, x, eps, z=0.0, y=0.0):
        """Rates along, across, and of the third coordinate on side k (0: above)."""
        a, b, c, d, k1, e, g, q, m, h1, h2, s = self.p[k]
        return a + b * x + c * y + d * eps, k1 * x + e * eps + g * y + q * x * x, m + h1 * x + h2 * eps + s * z

    def third(self, x: float, eps: float) -> float:
        """The third coordinate at which both fields are antiparallel in it, too."""
        (a, _, up), (b, _, down) = (self.rates(k, x, eps) for k in (0, 1))
        return -(a * down - b * up) / (a * self.p[1][-1] - b * self.p[0][-1])

    def place(self, eps: float) -> np.ndarray:
        """The pseudo-equilibrium, by SciPy, in the coordinates of the system."""

        def across(x: float) -> float:
            (a, rise, _), (b, fall, _) = (self.rates(k, x, eps) for k in (0, 1))
            return a * fall - b * rise

        x = brentq(across, -0.5, 0.5, xtol=1e-15)
        return self.units * (self.turn @ np.array([x, 0.0, self.third(x, eps)][: self.n]))

    def system(self) -> saltus.HybridSystem:
        names = ("X", "Y", "Z")[: self.n]
        into, out = (self.turn.T / self.units).tolist(), (self.units[:, None] * self.turn).tolist()
        own = [" + ".join(f"({share!r})*{name}" for share, name in zip(row, names, strict=True)) for row in into]
        x, y, z = (f"({text})" for text in (*own, "0")[:3])
        fields = []
        for k in (0, 1):
            a, b, c, d, k1, e, g, q, m, h1, h2, s = (repr(float(v)) for v in self.p[k])
            rates = [f"{a} + {b}*{x} + {c}*{y} + {d}*eps", f"{k1}*{x} + {e}*eps + {g}*{y} + {q}*{x}**2",
                     f"{m} + {h1}*{x} + {h2}*eps + {s}*{z}"]  # fmt: skip
            sums = (" + ".join(f"({share!r})*({rate})" for share, rate in zip(row, rates, strict=False)) for row in out)
            fields.append(dict(zip(names, sums, strict=True)))
        return saltus.filippov(names, {"eps": 0.0}, surface=y, above=fields[0], below=fields[1])


@pytest.mark.parametrize("seed", guarding(range(40), 1, campaign=10))
def test_pseudo_equilibrium_goes_through_a_two_fold(seed):
    random = Random(seed)
    system = random.system()
    for end in (-RANGE, RANGE):
        start = saltus.find_equilibrium(system, {"eps": 0.9 * end}, x0=random.place(0.9 * end), mode="sliding")
        branch = saltus.continue_equilibrium(start, "eps", (-RANGE, RANGE))
        told = [(point.type, point.kind) for point in branch.special_points]
        assert told == [("BE", "two-fold")], f"seed {seed}: {branch}"
        assert abs(branch["BE1"].parameters["eps"]) < 1e-10
        assert not branch.audit.breaches, f"seed {seed}: {branch.audit}"
        assert np.ptp(branch.values) == pytest.approx(2 * RANGE)
        for eps, state in zip(branch.values, branch.states, strict=True):
            np.testing.assert_allclose(state / random.units, random.place(eps) / random.units, atol=1e-9)


WELANDER = {  # Welander 1982, Leifeld 2016: the overturning of an ocean of two boxes
    "above": {"T": "1 - 2*T", "S": "0.5*(1 - S) - S"},
    "below": {"T": "1 - T", "S": "0.5*(1 - S)"},
}


def test_welanders_branch_and_the_locus_of_its_two_folds():
    welander = saltus.filippov(("T", "S"), {"eps": 0.01, "m": 0.8}, surface="S - m*T - eps", **WELANDER)
    start = saltus.find_equilibrium(welander, {"eps": -0.02}, x0=[0.7, 0.55], mode="sliding")
    branch = saltus.continue_equilibrium(start, "eps", (-0.3, 0.3))
    told = [(point.type, point.parameters["eps"]) for point in branch.special_points]
    assert [name for name, _ in told] == ["BE", "BE", "BE"]
    np.testing.assert_allclose([eps for _, eps in told], [-1 / 15, 0.0, 0.2], atol=1e-11)
    assert not branch.audit.breaches
    assert branch["BE2"].kind == "two-fold"
    assert "one eigenvalue passes infinity" in repr(branch["BE2"])
    np.testing.assert_allclose(branch["BE2"].solution.state, [0.75, 0.6], atol=1e-12)
    assert saltus.verify(branch["BE2"]).passed
    # both fields cross the surface at T m/2 + 1/2 - m, for eps = 0
    locus = saltus.continue_locus(branch["BE2"], ("eps", "m"), {"eps": (-0.3, 0.3), "m": (0.6, 1.1)})
    assert not locus.special_points
    assert not locus.audit.breaches
    eps, m = locus.values.T
    np.testing.assert_allclose(eps, 0.0, atol=1e-11)
    np.testing.assert_allclose(locus.states[:, 0], (2 * m - 1) / m, atol=1e-10)
    assert np.ptp(m) == pytest.approx(0.5)


def test_equilibrium_at_a_two_fold_is_found():
    welander = saltus.filippov(("T", "S"), {"eps": 0.0}, surface="S - 0.8*T - eps", **WELANDER)
    for x0 in ([0.75, 0.6], [0.7501, 0.6001], [0.74, 0.59]):
        found = saltus.find_equilibrium(welander, x0=x0, mode="sliding")
        np.testing.assert_allclose(found.state, [0.75, 0.6], atol=1e-12)
        branch = saltus.continue_equilibrium(found, "eps", (-0.3, 0.3))
        np.testing.assert_allclose([p.parameters["eps"] for p in branch.special_points], [-1 / 15, 0, 0.2], atol=1e-11)
