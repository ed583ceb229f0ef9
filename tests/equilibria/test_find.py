"""Equilibria found by Newton's method, as results: state, eigenvalues, kind, whether they are regular."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fields
import saltus
from saltus import HybridSystem, Mode, Transition, find_equilibrium
from saltus.equilibria import Equilibrium
from saltus.errors import ConvergenceError, InputError


def test_lorenz_has_the_eigenvalues_of_its_characteristic_polynomial():
    """At x = y = sqrt(b (r - 1)) it is s^3 + (sigma + b + 1) s^2 + b (r + sigma) s + 2 b sigma (r - 1)."""
    r, b, sigma = 24.0, 8.0 / 3.0, 10.0
    found = find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0])
    side = math.sqrt(b * (r - 1.0))
    assert found.state == pytest.approx([side, side, r - 1.0], rel=1e-14)
    assert found["z"] == found.state[2]
    wanted = np.roots([1.0, sigma + b + 1.0, b * (r + sigma), 2.0 * b * sigma * (r - 1.0)])
    order = np.lexsort((-wanted.imag, -wanted.real))
    assert found.eigenvalues == pytest.approx(wanted[order], rel=1e-12)
    assert (found.stable, found.regular, found.kind, found.mode) == (True, True, "stable focus", "flow")
    assert found.residual < 1e-13


@pytest.mark.parametrize(
    ("field", "kind"),
    [
        ({"x": "-x", "y": "-2*y"}, "stable node"),
        ({"x": "x", "y": "2*y"}, "unstable node"),
        ({"x": "-x", "y": "2*y"}, "saddle (1 unstable)"),
        ({"x": "x - y", "y": "x + y"}, "unstable focus"),
        ({"x": "-y", "y": "x"}, "not hyperbolic"),
        ({"x": "-x**3"}, "not hyperbolic"),
    ],
)
def test_kinds_in_words(field, kind):
    found = find_equilibrium(fields.system(field, {}))
    assert found.kind == kind
    assert found.stable is kind.startswith("stable")


@pytest.mark.parametrize("place", fields.PLANES)
def test_coordinates_and_units_change_no_eigenvalue(place):
    plane = fields.PLANES[place]
    system = plane.system(fields.BRUSSELATOR, {"A": 2.0, "B": 3.0})
    found = find_equilibrium(system, x0=plane.to([2.1, 1.4]))
    assert plane.back(found.state) == pytest.approx([2.0, 1.5], rel=1e-9)
    trace, determinant = 3.0 - 1.0 - 4.0, 4.0
    root = np.sqrt(complex(trace**2 / 4.0 - determinant))
    assert found.eigenvalues == pytest.approx([trace / 2.0 + root, trace / 2.0 - root], rel=1e-8)
    assert found.residual < 1e-10


def test_an_equilibrium_beyond_an_event_is_virtual_and_says_why():
    inner = find_equilibrium(fields.chua(d=0.1), mode="inner", x0=[-0.5, 0.0, 0.5])
    assert inner.state == pytest.approx([-0.7, 0.0, 0.7], abs=1e-14)
    assert inner.regular
    virtual = find_equilibrium(fields.chua(d=0.5), mode="inner", x0=[-3.0, 0.0, 3.0])
    assert virtual.state == pytest.approx([-3.5, 0.0, 3.5], abs=1e-13)
    assert virtual.reasons == ("it lies beyond the event down: x + 1 is -2.5",)
    assert "virtual: it lies beyond" in repr(virtual)
    outer = find_equilibrium(fields.chua(d=0.1), mode="plus", x0=[2.0, 0.0, -2.0])
    assert outer.state == pytest.approx([3.5 * 0.1 + 1.5, 0.0, -1.85], abs=1e-13)


def test_outside_the_domain_of_its_mode_an_equilibrium_is_virtual():
    system = HybridSystem(("x",), {"a": -1.0}, {"m": Mode({"x": "a - x"}, domain="x")})
    found = find_equilibrium(system, mode="m", x0=[1.0])
    assert found.reasons == ("x is -1, not positive as in the domain of m",)
    assert find_equilibrium(system, {"a": 1.0}, x0=[0.5], mode="m").regular


def test_a_mode_is_that_of_the_start_unless_it_is_given():
    system = fields.two_slopes()
    assert find_equilibrium(system, x0=[-0.4, 0.2]).mode == "left"
    assert find_equilibrium(system, {"m": 0.5}, x0=[0.4, 0.2]).mode == "right"
    assert not find_equilibrium(system, x0=[-0.5, -0.1], mode="right").regular


def test_a_saved_equilibrium_is_loaded_as_it_was(tmp_path):
    for found in (
        find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0]),
        find_equilibrium(fields.chua(d=0.5), mode="inner", x0=[-3.0, 0.0, 3.0]),
    ):
        again = saltus.load(found.save(tmp_path / "equilibrium.nc"))
        assert isinstance(again, Equilibrium)
        assert again == found
        assert (again.kind, again.reasons, again.mode) == (found.kind, found.reasons, found.mode)
        assert dict(again.parameters) == dict(found.parameters)


def test_what_cannot_be_used_is_told():
    lorenz = fields.lorenz()
    forced = HybridSystem(("x",), {"w": 1.0}, {"m": Mode({"x": "-x + cos(s)"})}, phase=("s", "w"), name="forced")
    with pytest.raises(InputError, match=r"system = 'forced': must be autonomous.*find_orbit, continue_orbit"):
        find_equilibrium(forced, x0=[0.0])
    with pytest.raises(InputError, match="did you mean 'flow'"):
        find_equilibrium(lorenz, mode="flwo")
    with pytest.raises(InputError, match="did you mean 'sigma'"):
        find_equilibrium(lorenz, {"sigmma": 1.0})
    with pytest.raises(InputError, match="x0 = "):
        find_equilibrium(lorenz, x0=[1.0])
    with pytest.raises(InputError, match="system = 'str'|system = 'Lorenz'"):
        find_equilibrium("Lorenz")
    with pytest.raises(InputError, match="did you mean|state = 'w'"):
        _ = find_equilibrium(lorenz)["w"]
    pole = fields.system({"x": "1/x"}, {})
    with pytest.raises(InputError, match="a state at which the field and its derivatives are finite"):
        find_equilibrium(pole, x0=[0.0])


def test_where_there_is_none_the_reason_is_told():
    with pytest.raises(ConvergenceError, match="there may be no equilibrium in this mode|singular there"):
        find_equilibrium(fields.system({"x": "1 + x**2"}, {}), x0=[0.3])
    with pytest.raises(ConvergenceError):
        find_equilibrium(fields.system({"x": "exp(x)"}, {}), x0=[0.0])


@pytest.mark.parametrize("field", ["x*log(x) - 0.4*x", "exp(-1/x) - 0.4*x", "sqrt(x)*(1 - x) - 0.4*x"])
def test_a_state_without_finite_derivatives_is_told(field):
    with pytest.raises(ConvergenceError, match="comes to x = .*, where the field has no finite derivatives"):
        find_equilibrium(fields.system({"x": field}, {}), x0=[0.01])


def test_an_identity_reset_does_not_matter_to_a_mode_of_its_own():
    system = HybridSystem(
        ("x", "y"),
        {"mu": 0.3},
        {"m": Mode({"x": "mu - x", "y": "-y"})},
        [Transition("m", "m", "x - 1", 1, {"x": "0"}, name="back")],
    )
    assert find_equilibrium(system, x0=[0.0, 0.0]).state == pytest.approx([0.3, 0.0], abs=1e-15)
    assert not find_equilibrium(system, {"mu": 2.0}, x0=[0.0, 0.0]).regular


def test_a_map_has_fixed_points_instead():
    doubling = saltus.Map(("x",), {"r": 2.8}, {"x": "r*x*(1 - x)"})
    with pytest.raises(InputError, match="this is a map: use solve_orbit, find_orbit"):
        find_equilibrium(doubling, x0=[0.6])
