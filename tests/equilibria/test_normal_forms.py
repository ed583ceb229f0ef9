"""Normal forms of critical equilibria against closed forms, in any coordinates."""

from __future__ import annotations

import numpy as np
import pytest

import fields
from saltus import continue_equilibrium, continue_locus, find_equilibrium
from saltus.equilibria.normal_forms import EquilibriumNormalForm
from selection import guarding


def _length(plane: fields.Coordinates, q: list) -> float:
    """Return the length of a vector in the plane's coordinates."""
    return float(np.linalg.norm(plane.matrix @ np.array(q)))


@pytest.mark.parametrize("place", fields.PLANES)
def test_first_lyapunov_coefficient_of_the_hopf_normal_form(place):
    """It is -2/w for q = (1, -i)/sqrt(2); in coordinates M x + c it belongs to q / |M q|."""
    plane = fields.PLANES[place]
    start = find_equilibrium(plane.system(fields.HOPF, {"mu": -0.5, "w": 3.0}), x0=plane.to([0.01, 0.0]))
    form = continue_equilibrium(start, "mu", (-1.0, 1.0))["HB1"].normal_form
    assert form.criticality == "supercritical"
    assert form.frequency == pytest.approx(3.0, rel=1e-12)
    assert form.coefficient * _length(plane, [1.0, -1.0j]) ** 2 == pytest.approx(-4.0 / 3.0, rel=1e-6)


@pytest.mark.parametrize(("A", "l1"), [(1.0, -1.0 / 2.0), (2.0, -1.0 / 6.0)])
def test_brusselator_loses_stability_softly(A, l1):
    start = find_equilibrium(fields.system(fields.BRUSSELATOR, {"A": A, "B": 0.8}), x0=[A, 0.8 / A])
    point = continue_equilibrium(start, "B", (0.5, 6.0))["HB1"]
    assert point.parameters["B"] == pytest.approx(1.0 + A * A, rel=1e-12)
    form = point.normal_form
    assert form.frequency == pytest.approx(A, rel=1e-12)
    assert form.coefficient == pytest.approx(l1, rel=1e-9)
    assert "supercritical" in repr(form)


def test_lorenz_loses_stability_hard():
    form = continue_equilibrium(find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0]), "r", (15.0, 30.0))["HB1"]
    assert form.normal_form.coefficient == pytest.approx(2.655189725837e-4, rel=1e-9)
    assert form.normal_form.frequency == pytest.approx(9.624530063715756, rel=1e-12)
    assert form.normal_form.criticality == "subcritical"


@pytest.mark.parametrize("place", ["as printed", "rotated and shifted", "nanometres"])
def test_saddle_node_and_bogdanov_takens_have_the_coefficients_of_the_closed_form(place):
    """At b2 = -1 the fold has q = (1, 0), p = (1, 2) and a = 2; the Bogdanov-Takens point has a b = -1."""
    plane = fields.PLANES[place]
    start = find_equilibrium(plane.system(fields.TAKENS, {"b1": -1.0, "b2": -1.0}), x0=plane.to([-1.0, 0.0]))
    fold = continue_equilibrium(start, "b1", (-2.0, 2.0))["SN1"]
    length = _length(plane, [1.0, 0.0])
    assert abs(fold.normal_form.coefficient) * length == pytest.approx(2.0, rel=1e-6)
    assert fold.normal_form.criticality == "nondegenerate"
    locus = continue_locus(fold, ("b1", "b2"), {"b1": (-1.0, 2.0), "b2": (-2.0, 2.0)})
    assert locus["BT1"].normal_form.coefficient * length**2 == pytest.approx(-1.0, rel=1e-5)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_coefficient_of_a_cusp_tells_its_two_kinds(sign):
    system = fields.system({"x": "r + h*x - s*x**3"}, {"r": 0.0, "h": 1.5 * sign, "s": sign})
    branch = continue_equilibrium(find_equilibrium(system, x0=[1.2]), "r", (-2.0, 2.0))
    locus = continue_locus(branch["SN1"], ("r", "h"), {"r": (-2.0, 2.0), "h": (-2.0, 2.0)})
    assert locus["CP1"].normal_form.coefficient == pytest.approx(-sign, rel=1e-9)
    assert locus["CP1"].normal_form.frequency == 0.0


def test_of_a_linear_field_the_hopf_point_is_degenerate():
    branch = continue_equilibrium(find_equilibrium(fields.chua(), mode="plus", x0=[1.5, 0.0, -1.5]), "be", (15.0, 30.0))
    assert branch["HB1"].normal_form.criticality == "degenerate"
    assert branch["HB1"].normal_form.coefficient == 0.0


def test_a_point_without_a_normal_form_says_so():
    system = fields.system({"x": "mu*x - x**2"}, {"mu": 1.0})
    branch = continue_equilibrium(find_equilibrium(system, x0=[1.0]), "mu", (-1.0, 2.0))
    assert repr(branch["BP1"].normal_form) == (
        "NoNormalForm BP: two branches cross there; switch_branch(point) goes to the other one"
    )


STIFF = [(seed, rate) for seed in range(30) for rate in (1e10, 1e13, 1e16, 1e18)]


@pytest.mark.parametrize(("seed", "rate"), guarding(STIFF, (0, 1e16), (1, 1e18), (2, 1e13), campaign=40))
def test_the_first_lyapunov_coefficient_beside_fast_decays_is_that_of_the_plane(seed, rate):
    """Fast states follow g(x, y): Guckenheimer and Holmes (3.4.11) give r' = a r^3, so that l1 = 2 a / w."""
    draw = np.random.default_rng(seed)
    w, count = float(draw.uniform(0.05, 3.0)), int(draw.integers(1, 4))
    f, g = draw.uniform(-1.0, 1.0, (2, 7)).tolist()
    terms = ["x**2", "x*y", "y**2", "x**3", "x**2*y", "x*y**2", "y**3"]
    bends = [" + ".join(f"{c!r}*{t}" for c, t in zip(row, terms, strict=True)) for row in (f, g)]
    slopes, back = draw.uniform(-2.0, 2.0, (count, 2)).tolist(), draw.uniform(-1.0, 1.0, (2, count)).tolist()
    follows = [f"({a!r}*x + {b!r}*y + x**2)" for a, b in slopes]
    beside = [" + ".join(f"{c!r}*(z{i} - {follows[i]})" for i, c in enumerate(row)) for row in back]
    field = {"x": f"m*x - {w!r}*y + {bends[0]} + {beside[0]}", "y": f"{w!r}*x + m*y + {bends[1]} + {beside[1]}"}
    field |= {f"z{i}": f"{rate * 3.0**i!r}*({follows[i]} - z{i})" for i in range(count)}
    start = find_equilibrium(fields.system(field, {"m": -0.1}), x0=[0.0] * (2 + count))
    (point,) = continue_equilibrium(start, "m", (-0.2, 0.2)).special_points.of_type("HB")
    a = (3.0 * f[3] + f[5] + g[4] + 3.0 * g[6]) / 8.0
    a += (f[1] * (f[0] + f[2]) - g[1] * (g[0] + g[2]) - 2.0 * f[0] * g[0] + 2.0 * f[2] * g[2]) / (8.0 * w)
    length = 1.0 + sum(one * one + other * other for one, other in slopes) / 2.0
    form = point.normal_form
    assert form.frequency == pytest.approx(w, rel=1e-8)
    assert abs(form.coefficient - 2.0 * a / (w * length)) < form.error + 1e-8 * abs(a / w)
    assert form.error < 1e-3 * abs(form.coefficient)


@pytest.mark.parametrize("rate", [1e3, 1e9, 1e13, 1e15, 1e17])
def test_a_coefficient_that_the_last_bits_of_fast_rates_decide_has_an_error_or_a_reason(rate):
    """x and z change places so fast that only their sum counts: x' = K (z - x) + 2 f, z' = K (x - z)."""
    field = {"x": f"{rate!r}*(z - x) + 2*(m*x - y - x**3)", "y": "x + m*y", "z": f"{rate!r}*(x - z)"}
    system = fields.system(field, {"m": -0.1})
    for point in continue_equilibrium(find_equilibrium(system, x0=[0.0] * 3), "m", (-0.2, 0.2)).special_points:
        form = point.normal_form
        # q = (1, -i, 1)/sqrt(3) to the order 1/K: the mean of both rates has the terms of a van der Pol's
        known = isinstance(form, EquilibriumNormalForm)
        assert known or "too fast" in form.reason
        assert not known or abs(form.coefficient + 0.5) < form.error + 10.0 / rate + 1e-6
