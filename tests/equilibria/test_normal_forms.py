"""Normal forms of critical equilibria against closed forms, in any coordinates."""

from __future__ import annotations

import numpy as np
import pytest

import fields
from saltus import continue_equilibrium, continue_locus, find_equilibrium


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
