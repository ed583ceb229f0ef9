"""Loci and points of codimension two against closed forms: carried maps, impacting oscillators, planar fields."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import sympy
from scipy.optimize import brentq

import systems
from oracles.closed_forms import CUSP, DELAYED, HENON, ImpactOrbit, TableJump, free_motion, henon_fixed_point
from saltus import (
    HybridSystem,
    InputError,
    Mode,
    StepControl,
    Transition,
    continue_locus,
    continue_orbit,
    load as load_result,
    solve_orbit,
)
from selection import guarding

CLOSE = 1e-8
"""What a locus promises: parameters, multipliers and contacts to this."""


def carried(image, **parameters):
    return systems.carried_map(tuple(image), parameters, image)


def cycle(system, points, **parameters):
    """The orbit through the given points of a carried map."""
    return solve_orbit(system, parameters, [("carry", "map", [*np.atleast_1d(x), 0.0], 1.0) for x in points])


def places(locus, kind):
    """Both parameters of the special points of a type, in the order of the first, then of the second."""
    return sorted(tuple(p.parameters[name] for name in locus.names) for p in locus.special_points.of_type(kind))


def assert_points(locus, expected, tolerance=CLOSE):
    """The locus has exactly the expected special points, {type: places}; turning points only if they are named."""
    kinds = {p.type for p in locus.special_points} - {"TP"} | set(expected)
    for kind in kinds:
        got, wanted = places(locus, kind), sorted(expected.get(kind, []))
        assert len(got) == len(wanted), f"{kind}: {got}, not {wanted}"
        if wanted:
            np.testing.assert_allclose(got, wanted, rtol=0.0, atol=tolerance, err_msg=kind)


def assert_critical(locus, every=1):
    """The orbits, computed anew from the stored unknowns, have the critical multipliers that the locus promises.

    The characteristic polynomial vanishes; where no other multiplier is near, so does the distance.
    """
    for i in range(0, len(locus), every):
        orbit = locus.solution(i)
        assert orbit.residual < 1e-9
        values = orbit.multipliers[:-1] if orbit.system.phase is None else orbit.multipliers
        critical = np.exp(1j * locus.angle[i])
        size = max(1.0, float(np.abs(values).max()))
        assert abs(np.prod((values - critical) / size)) < CLOSE
        if (np.sort(np.abs(values - critical))[1:2] > 0.05).all():
            assert np.abs(values - critical).min() < CLOSE


# a change of coordinates that makes a planar map's normal form hard to see


def conjugated(image, bend=0.3, twist=-0.2, shift=(0.4, -0.7)):
    """The image of a planar map in (x + bend y^2, y), then (x, y + twist x^2), then shifted."""
    x, y = sympy.symbols("x y")
    across, up = x - shift[0], y - shift[1]
    y0 = up - twist * across**2
    x0 = across - bend * y0**2
    f, g = (sympy.sympify(image[name]).subs({x: x0, y: y0}, simultaneous=True) for name in ("x", "y"))
    first = f + bend * g**2
    return {"x": str(first + shift[0]), "y": str(g + twist * first**2 + shift[1])}


def moved(x, y, bend=0.3, twist=-0.2, shift=(0.4, -0.7)):
    """Where `conjugated` takes a point."""
    across = x + bend * y**2
    return across + shift[0], y + twist * across**2 + shift[1]


# Henon: det -b, trace -2 x


@pytest.fixture(scope="module")
def henon():
    x = henon_fixed_point(0.2, 0.3)
    return continue_orbit(cycle(carried(HENON, a=0.2, b=0.3), [(x, x)]), "a", (-1.0, 1.5))


@pytest.mark.parametrize("steps", [StepControl(largest=0.05), None, StepControl(largest=0.3)])
def test_henons_fold_locus_goes_through_r1_and_the_fold_flip(henon, steps):
    locus = continue_locus(henon["SN1"], ("a", "b"), {"a": (-3.0, 5.0), "b": (-2.0, 2.0)}, steps=steps)
    a, b = locus.values.T
    np.testing.assert_allclose(a, -((1.0 - b) ** 2) / 4.0, atol=CLOSE)
    np.testing.assert_allclose(locus.x0[:, 0], (b - 1.0) / 2.0, atol=CLOSE)
    assert_points(locus, {"R1": [(-1.0, -1.0)], "FF": [(0.0, 1.0)], "TP": [(0.0, 1.0)]})
    assert [p.of for p in locus.special_points.of_type("TP")] == ["a"]
    np.testing.assert_array_equal(locus.stable, np.abs(b) < 1.0)
    assert (locus.angle == 0.0).all()
    assert_critical(locus)
    assert {reason.split(": ")[1] for reason in locus.stopped} == {"bound reached"}
    assert sorted(b[[0, -1]]) == pytest.approx([-2.0, 2.0], abs=1e-12)


def test_henons_doubling_locus_up_to_the_fold_flip_goes_through_r2(henon):
    locus = continue_locus(henon["PD1"], ("a", "b"), {"a": (-3.0, 5.0), "b": (-2.0, 0.9)})
    a, b = locus.values.T
    np.testing.assert_allclose(a, 0.75 * (1.0 - b) ** 2, atol=CLOSE)
    assert_points(locus, {"R2": [(3.0, -1.0)]})
    np.testing.assert_array_equal(locus.stable, np.abs(b) < 1.0)
    assert_critical(locus)


@pytest.mark.campaign
def test_henons_doubling_locus_goes_through_the_fold_flip(henon):
    locus = continue_locus(henon["PD1"], ("a", "b"), {"a": (-3.0, 5.0), "b": (-2.0, 2.0)})
    a, b = locus.values.T
    np.testing.assert_allclose(a, 0.75 * (1.0 - b) ** 2, atol=CLOSE)
    assert_points(locus, {"R2": [(3.0, -1.0)], "FF": [(0.0, 1.0)], "TP": [(0.0, 1.0)]})
    assert b.max() == pytest.approx(2.0)
    assert_critical(locus)


@pytest.mark.campaign
def test_the_torus_locus_of_an_area_preserving_map_is_traced():
    """At b = -1 Henon's map keeps areas: all of the line is a torus locus whose coefficient is nothing but zero."""
    x = -1.0 + math.sqrt(1.5)
    start = cycle(carried(HENON, a=0.5, b=-1.0), [(x, x)])
    locus = continue_locus(start, ("a", "b"), {"a": (-3.0, 5.0), "b": (-2.0, 1.0)}, type="TR")
    np.testing.assert_allclose(locus.values[:, 1], -1.0, atol=CLOSE)
    expected = {"R1": [(-1.0, -1.0)], "R2": [(3.0, -1.0)], "R3": [(1.25, -1.0)], "R4": [(0.0, -1.0)]}
    assert {kind: len(places(locus, kind)) for kind in expected} == dict.fromkeys(expected, 1), locus.stopped
    for kind, place in expected.items():
        np.testing.assert_allclose(places(locus, kind), place, atol=CLOSE)
    np.testing.assert_allclose((1.0 - np.cos(locus.angle)) ** 2, 1.0 + locus.values[:, 0], atol=CLOSE)


# the delayed logistic map: fixed point 1 - 1/a, det a - 1 - c, trace 1 - c


@pytest.fixture(scope="module")
def delayed():
    return carried(DELAYED, a=1.5, c=1.2)


BOX = {"a": (0.5, 8.0), "c": (-3.0, 5.0)}
RESONANCES = {"R1": [(1.0, -1.0)], "R4": [(3.0, 1.0)], "R3": [(4.0, 2.0)], "R2": [(5.0, 3.0)]}


@pytest.mark.campaign
@pytest.mark.parametrize("largest", [0.03, 0.1, 0.3])
@pytest.mark.parametrize("c", guarding([-0.9, 0.2, 1.2, 2.5], campaign=2))
def test_torus_locus_runs_from_r1_through_r4_and_r3_to_r2(delayed, c, largest):
    a = 1.95 + c
    branch = continue_orbit(cycle(delayed, [(1 - 1 / a, 1 - 1 / a)], a=a, c=c), "a", (a - 0.05, a + 0.3))
    locus = continue_locus(branch["TR1"], ("a", "c"), BOX, steps=StepControl(largest=largest))
    first, second = locus.values.T
    np.testing.assert_allclose(first, 2.0 + second, atol=CLOSE)
    assert_points(locus, RESONANCES)
    ends = {reason.split(": ", 1)[1] for reason in locus.stopped}
    assert ends == {f"{name}: beyond it the two multipliers are real, of product 1" for name in ("R1", "R2")}
    np.testing.assert_allclose(np.cos(locus.angle), (1.0 - second) / 2.0, atol=CLOSE)
    assert_critical(locus)
    assert [p.label for p in locus.special_points.of_type("R3")] == ["R3_1"]
    assert locus["R4_1"].locus == "TR"


@pytest.mark.campaign
def test_the_order_of_the_names_is_the_users(delayed):
    branch = continue_orbit(cycle(delayed, [(1 / 3, 1 / 3)]), "a", (1.2, 4.0))
    there, back = (continue_locus(branch["TR1"], names, BOX) for names in (("a", "c"), ("c", "a")))
    assert (there.names, back.names) == (("a", "c"), ("c", "a"))
    assert there.varied == there.names
    np.testing.assert_allclose(there.values, back.values[:, ::-1], atol=1e-12)
    np.testing.assert_array_equal(back.column("c"), back.values[:, 0])
    assert places(back, "R3")[0] == pytest.approx((2.0, 4.0), abs=CLOSE)


def test_doubling_locus_meets_the_torus_locus_at_r2(delayed):
    branch = continue_orbit(cycle(delayed, [(1 / 3, 1 / 3)]), "a", (1.2, 4.0))
    locus = continue_locus(branch["PD1"], ("a", "c"), {"a": (1.1, 8.0), "c": (-3.0, 5.0)})
    a, c = locus.values.T
    np.testing.assert_allclose(a, 2.0 * c - 1.0, atol=CLOSE)
    assert_points(locus, {"R2": [(5.0, 3.0)]})
    assert_critical(locus)


@pytest.mark.campaign
def test_doubling_locus_passes_the_transcritical_line(delayed):
    """At (1, 1) the fixed point exchanges its place with the one at 0: the multipliers are 1 and -1."""
    branch = continue_orbit(cycle(delayed, [(1 / 3, 1 / 3)]), "a", (1.2, 4.0))
    locus = continue_locus(branch["PD1"], ("a", "c"), BOX)
    a, c = locus.values.T
    np.testing.assert_allclose(a, 2.0 * c - 1.0, atol=CLOSE)
    assert a.min() == pytest.approx(0.5)
    assert places(locus, "R2") == [pytest.approx((5.0, 3.0), abs=CLOSE)]
    met = [p for p in locus.special_points if p.type in ("FF", "BP")]
    assert [p.parameters["a"] for p in met] == [pytest.approx(1.0, abs=CLOSE)]


@pytest.mark.parametrize("pair", [("a", "c"), ("c", "a")])
def test_transcritical_points_form_a_locus(delayed, pair):
    branch = continue_orbit(cycle(delayed, [(1 / 3, 1 / 3)]), "a", (0.8, 1.8))
    locus = continue_locus(branch["BP1"], pair, BOX)
    np.testing.assert_allclose(locus.column("a"), 1.0, atol=CLOSE)
    np.testing.assert_allclose(locus.x0, 0.0, atol=CLOSE)
    assert sorted(locus.column("c")[[0, -1]]) == pytest.approx([-3.0, 5.0], abs=1e-12)
    assert {reason.split(": ")[1] for reason in locus.stopped} == {"bound reached"}
    for orbit in locus:
        assert np.abs(orbit.multipliers[:-1] - 1.0).min() < CLOSE


def test_a_pitchfork_persists_only_where_the_symmetry_does():
    system = carried({"x": "h*x - x**3 + r + k*x*y", "y": "y/2 + x**2/4"}, h=0.8, r=0.0, k=0.3)
    branch = continue_orbit(cycle(system, [(0.0, 0.0)]), "h", (0.5, 1.5))
    assert branch["BP1"].parameters["h"] == pytest.approx(1.0, abs=CLOSE)
    kept = continue_locus(branch["BP1"], ("h", "k"), {"h": (0.5, 1.5), "k": (-1.0, 1.0)})
    np.testing.assert_allclose(kept.column("h"), 1.0, atol=CLOSE)
    assert {reason.split(": ")[1] for reason in kept.stopped} == {"bound reached"}
    lost = continue_locus(branch["BP1"], ("h", "r"), {"h": (0.5, 1.5), "r": (-1.0, 1.0)})
    assert all(reason.endswith("the parameters unfold it") for reason in lost.stopped), lost.stopped
    assert len(lost) < 5


# cusp


def fold_of_cusp(h):
    return 2.0 * ((h - 1.0) / 3.0) ** 1.5


@pytest.mark.campaign
def test_cusp_locus_is_the_semicubical_parabola():
    branch = continue_orbit(cycle(carried(CUSP, r=0.0, h=1.5), [math.sqrt(0.5)]), "r", (-1.0, 1.0))
    bounds = {"r": (-1.0, 1.0), "h": (0.5, 2.0)}
    locus = continue_locus(branch["SN1"], ("r", "h"), bounds)
    r, h = locus.values.T
    np.testing.assert_allclose(np.abs(r), fold_of_cusp(np.maximum(h, 1.0)), atol=CLOSE)
    np.testing.assert_allclose(h, 1.0 + 3.0 * locus.x0[:, 0] ** 2, atol=CLOSE)
    assert_points(locus, {"CP": [(0.0, 1.0)]})
    assert (r.min(), r.max()) == pytest.approx((-fold_of_cusp(2.0), fold_of_cusp(2.0)), abs=CLOSE)
    inner = np.abs(locus.x0[:, 0]) > 1e-6
    signs = np.sign(locus.coefficient[inner] * locus.x0[inner, 0])
    assert np.ptp(signs) == 0.0
    assert_critical(locus)
    again = continue_locus(locus["CP1"], ("r", "h"), bounds)
    assert sorted(again.values[[0, -1], 0]) == pytest.approx(sorted(r[[0, -1]]), abs=CLOSE)


UNFOLDED = {"x": "r + h*(x - 0.4) - (x - 0.4)**3 + u*(1 + (x - 0.4)/2) + 0.3*u**2*(x - 0.4)**2 + 0.4"}
"""A cusp at (r, h, u) = (0, 1, 0) and x = 0.4 that every pair of the three parameters unfolds."""


@pytest.fixture(scope="module")
def unfolded():
    branch = continue_orbit(
        cycle(carried(UNFOLDED, r=0.0, h=1.5, u=0.0), [0.4 + math.sqrt(0.5)]), "r", (-1.0, 1.0), directions="down"
    )
    bounds = {"r": (-1.0, 1.0), "h": (0.5, 2.0)}
    return continue_locus(branch["SN1"], ("r", "h"), bounds)


@pytest.mark.parametrize("pair", [("r", "h"), ("r", "u"), ("h", "u"), ("u", "h")])
def test_another_locus_starts_from_the_cusp_in_any_pair(unfolded, pair):
    assert places(unfolded, "CP") == [pytest.approx((0.0, 1.0), abs=CLOSE)]
    limits = {"r": (-0.5, 0.5), "h": (0.6, 1.5), "u": (-0.4, 0.4)}
    locus = continue_locus(unfolded["CP1"], pair, {name: limits[name] for name in pair})
    start = {"r": 0.0, "h": 1.0, "u": 0.0}
    assert (np.abs(locus.values - [start[name] for name in pair]).max(axis=1) < CLOSE).any()
    y = locus.x0[:, 0] - 0.4
    r, h, u = (locus.column(name) if name in pair else start[name] for name in ("r", "h", "u"))
    assert np.ptp(y) > 0.1
    np.testing.assert_allclose(r + h * y - y**3 + u * (1 + y / 2) + 0.3 * u**2 * y**2 - y, 0.0, atol=CLOSE)
    np.testing.assert_allclose(h - 3 * y**2 + u / 2 + 0.6 * u**2 * y, 1.0, atol=CLOSE)
    assert {reason.split(": ")[1] for reason in locus.stopped} == {"bound reached"}


@pytest.mark.campaign
def test_any_point_of_a_locus_starts_a_branch_or_another_locus(unfolded):
    assert len(unfolded) > 9
    for i in (2, len(unfolded) // 3, -3):
        point = unfolded.point(i)
        assert point.type == "SN"
        other = continue_locus(point, ("r", "u"), {"r": (-1.5, 1.5), "u": (-0.3, 0.3)})
        y, r, u = other.x0[:, 0] - 0.4, other.column("r"), other.column("u")
        h = point.parameters["h"]
        np.testing.assert_allclose(r + h * y - y**3 + u * (1 + y / 2) + 0.3 * u**2 * y**2 - y, 0.0, atol=CLOSE)
        np.testing.assert_allclose(h - 3 * y**2 + u / 2 + 0.6 * u**2 * y, 1.0, atol=CLOSE)
        branch = continue_orbit(unfolded.solution(i), "r", (-1.5, 1.5))
        folds = [p.parameters["r"] for p in branch.special_points if p.type == "SN"]
        where = point.parameters["r"]
        at_start = min([abs(where - fold) for fold in folds], default=math.inf)
        # the fold itself is where the branch starts, so that only the other one need be passed
        far = abs(2.0 * where)
        assert min(at_start, min(abs(-where - fold) for fold in folds) if far > 1e-3 else 0.0) < CLOSE


def test_a_pair_that_leaves_the_cusp_unfolded_is_refused():
    """In (r, u) the folds of r + h x - x^3 + u x^2 at h = 1 are two curves that cross at the cusp."""
    system = carried({"x": "r + h*x - x**3 + u*x**2"}, r=0.0, h=1.5, u=0.0)
    branch = continue_orbit(cycle(system, [math.sqrt(0.5)]), "r", (-1.0, 1.0))
    cusp = continue_locus(branch["SN1"], ("r", "h"), {"r": (-1.0, 1.0), "h": (0.5, 2.0)})["CP1"]
    wanted = "these do not unfold the cusp"
    with pytest.raises(InputError, match=wanted):
        continue_locus(cusp, ("r", "u"), {"r": (-1.0, 1.0), "u": (-1.0, 1.0)})
    with pytest.raises(InputError, match=wanted):
        continue_locus(cusp, ("h", "u"), {"h": (0.5, 2.0), "u": (-1.0, 1.0)})


# points where the first coefficient changes sign, hidden by a change of coordinates


GPD = -5.0 / 36.0
"""x -> -(1 + m) x + b x^3 - x^5 + x y/3, y -> 2 y/5 + x^2/4: centre manifold y = 5 x^2/12, coefficient b + 5/36."""


@pytest.fixture(scope="module")
def flip():
    image = {"x": "-(1 + m + b/10)*x + b*x**3 - x**5 + x*y/3", "y": "2*y/5 + x**2/4"}
    system = carried(conjugated(image), m=-0.2, b=1.0)
    return continue_orbit(cycle(system, [moved(0.0, 0.0)]), "m", (-0.5, 0.5))


@pytest.mark.campaign
@pytest.mark.parametrize("largest", [0.02, 0.1, 0.3])
def test_generalised_period_doubling_is_where_the_coefficient_vanishes(flip, largest):
    bounds = {"m": (-0.5, 0.5), "b": (-2.0, 2.0)}
    locus = continue_locus(flip["PD1"], ("m", "b"), bounds, steps=StepControl(largest=largest))
    m, b = locus.values.T
    np.testing.assert_allclose(m, -b / 10.0, atol=CLOSE)
    assert_points(locus, {"GPD": [(-GPD / 10.0, GPD)], "TP": []})
    wanted = (b - GPD) / (locus.values[0, 1] - GPD)
    np.testing.assert_allclose(locus.coefficient / locus.coefficient[0], wanted, atol=1e-7)
    assert_critical(locus)


@pytest.mark.campaign
def test_coefficients_of_doublings_are_those_of_the_map(flip):
    """The change of coordinates has the identity as its derivative at the fixed point, so lengths there are kept."""
    bounds = {"m": (-0.5, 0.5), "b": (-2.0, 2.0)}
    locus = continue_locus(flip["PD1"], ("m", "b"), bounds)
    for i in range(0, len(locus), 3):
        form = locus.point(i).normal_form
        b = locus.values[i, 1]
        assert form.coefficient == pytest.approx(b - GPD, abs=1e-8)
        if abs(b - GPD) > 1e-7:
            assert form.criticality == ("supercritical" if b > GPD else "subcritical")


@pytest.fixture(scope="module")
def rotation():
    square = "(x**2 + y**2)"
    radial, shear = f"(1 + d*{square} - {square}**2)", f"({square}/3)"
    u, v = f"(x*{radial} - y*{shear})", f"(y*{radial} + x*{shear})"
    image = {
        "x": f"(1 + m)*(cos(t + k*d)*{u} - sin(t + k*d)*{v})",
        "y": f"(1 + m)*(sin(t + k*d)*{u} + cos(t + k*d)*{v})",
    }
    # one of the two changes of coordinates gives both components square terms; with both, the texts are very long
    return carried(conjugated(image, twist=0.0), m=-0.1, d=1.0, t=1.0, k=0.1)


@pytest.mark.campaign
@pytest.mark.parametrize("angle", [0.3, 1.0, 2.4])
def test_chenciner_point_is_where_the_coefficient_vanishes(rotation, angle):
    """z -> (1 + m) exp(i angle) z (1 + (d + i/3) |z|^2 - |z|^4), hidden."""
    branch = continue_orbit(cycle(rotation, [moved(0.0, 0.0)], t=angle), "m", (-0.5, 0.5))
    assert branch["TR1"].normal_form.coefficient == pytest.approx(1.0 * 2.0, abs=1e-7)
    locus = continue_locus(branch["TR1"], ("m", "d"), {"m": (-0.5, 0.5), "d": (-2.0, 2.0)})
    m, d = locus.values.T
    np.testing.assert_allclose(m, 0.0, atol=CLOSE)
    np.testing.assert_allclose(locus.angle, angle + 0.1 * d, atol=CLOSE)
    resonant = {name: 10.0 * (value - angle) for name, value in (("R3", 2 * math.pi / 3), ("R4", math.pi / 2))}
    expected = {name: [(0.0, value)] for name, value in resonant.items() if abs(value) < 2.0}
    assert_points(locus, expected | {"CH": [(0.0, 0.0)]})
    np.testing.assert_allclose(locus.coefficient / locus.coefficient[0], d / d[0], atol=1e-7)
    assert_critical(locus)


@pytest.mark.campaign
def test_a_parameter_that_is_constant_along_a_locus_has_no_turning_points(rotation):
    branch = continue_orbit(cycle(rotation, [moved(0.0, 0.0)]), "m", (-0.5, 0.5))
    for pair in (("m", "d"), ("m", "t")):
        bounds = {"m": (-0.5, 0.5), "d": (-2.0, 2.0), "t": (0.2, 3.0)}
        locus = continue_locus(branch["TR1"], pair, {name: bounds[name] for name in pair})
        assert np.ptp(locus.column("m")) < CLOSE
        assert not locus.special_points.of_type("TP"), locus


ALONG, ACROSS, CUBIC = 0.7, 0.5, 1.2


@pytest.fixture(scope="module")
def fold_flip():
    """x -> r + x + x^2 + 0.7 y^2, y -> -(1 + m) y + 0.5 x y + 1.2 y^3, hidden: fixed points x^2 = -r, y = 0."""
    image = {
        "x": f"r + x + x**2 + {ALONG}*y**2",
        "y": f"-(1 + m)*y + {ACROSS}*x*y + {CUBIC}*y**3",
    }
    return carried(conjugated(image), r=-0.04, m=0.3)


@pytest.mark.campaign
def test_fold_locus_goes_through_the_fold_flip(fold_flip):
    branch = continue_orbit(cycle(fold_flip, [moved(-0.2, 0.0)]), "r", (-0.2, 0.2))
    locus = continue_locus(branch["SN1"], ("r", "m"), {"r": (-0.5, 0.5), "m": (-1.0, 1.0)})
    np.testing.assert_allclose(locus.column("r"), 0.0, atol=CLOSE)
    assert_points(locus, {"FF": [(0.0, 0.0)], "TP": []})
    assert_critical(locus)


@pytest.mark.campaign
def test_doubling_locus_goes_through_the_fold_flip(fold_flip):
    """Multiplier -(1 + m) + x/2 = -1: m = x/2, r = -x^2; with y^2's share of x the coefficient is 1.2 - 0.35/(2 x)."""
    branch = continue_orbit(cycle(fold_flip, [moved(-0.2, 0.0)]), "m", (-0.5, 0.5))
    assert branch["PD1"].normal_form.coefficient == pytest.approx(CUBIC + ALONG * ACROSS / 0.4, abs=1e-7)
    locus = continue_locus(branch["PD1"], ("r", "m"), {"r": (-0.5, 0.5), "m": (-1.0, 1.0)})
    r, m = locus.values.T
    np.testing.assert_allclose(r, -4.0 * m**2, atol=CLOSE)
    x = ALONG * ACROSS / (2.0 * CUBIC)
    assert_points(locus, {"FF": [(0.0, 0.0)], "GPD": [(-(x**2), ACROSS * x)], "TP": [(0.0, 0.0)]})
    assert_critical(locus)


# impact oscillator


def impact_orbit(w, m, U, **others):
    form = ImpactOrbit(w, m, **others)
    parameters = {"w": w, "A": form.amplitude(U), **others}
    return solve_orbit(systems.impact_oscillator(), parameters, [("free", "impact", form.after_impact(U), form.period)])


def primary(branch, kind):
    """The special point of that type of the orbit with one impact, at its own impact if it is a grazing."""
    for p in branch.special_points.of_type(kind):
        if len(p.orbit.signature) == 1 and (kind != "GR" or abs(p.orbit.max["x"] - 1.0) < 1e-6):
            return p
    raise AssertionError(f"no {kind}: {branch!r}")


W = math.sqrt(1.0 - 0.05**2)
MEETINGS = {
    (1, 1): (1.997498435544, 2.996664812754),
    (1, 2): (0.998749217772, 0.099906206013),
    (2, 3): (1.331665623696, 0.784715093380),
}
PLANE = {"w": (0.6, 3.5), "A": (0.005, 15.0)}


def test_the_meetings_are_the_closed_form():
    for (m, j), (w, A) in MEETINGS.items():
        assert w == pytest.approx(2.0 * m * W / j, abs=5.1e-13)
        assert ImpactOrbit(w, m).A_grazing == pytest.approx(A, abs=3e-12)


@pytest.mark.parametrize(("w", "m", "U"), [(1.1, 1, 0.5), (1.4, 1, 2.0), (2.5, 2, 1.2)])
def test_grazing_locus_is_the_closed_form_and_meets_folds_and_doublings(w, m, U):
    branch = continue_orbit(impact_orbit(w, m, U), "A", (0.01, 12.0))
    locus = continue_locus(primary(branch, "GR"), ("w", "A"), PLANE)
    assert_grazing_locus(locus)
    found = [
        (name, p.parameters["w"], p.parameters["A"])
        for name in ("SN", "PD")
        for p in locus.special_points.of_type(name)
    ]
    meetings = [2.0 * m * W / j for j in range(1, 9) if 0.6 < 2.0 * m * W / j < 3.5]
    for name in ("SN", "PD"):
        got = [(x, y) for kind, x, y in found if kind == name]
        wanted = sorted((x, ImpactOrbit(x, m).A_grazing) for x in meetings)
        np.testing.assert_allclose(sorted(got), wanted, atol=CLOSE, err_msg=name)
    turning = [p for p in locus.special_points.of_type("TP") if p.of == "A"]
    assert [p.parameters["w"] for p in turning] == [pytest.approx(math.sqrt(1.0 - 0.005), abs=CLOSE)]


def assert_grazing_locus(locus):
    for (w, A), orbit in zip(locus.values, locus, strict=True):
        form = ImpactOrbit(w)
        assert form.A_grazing == pytest.approx(A, abs=CLOSE)
        np.testing.assert_allclose(orbit.x0, form.linear_response(A)[1], atol=CLOSE)
        contact = orbit.segments[0].state
        assert abs(contact[0] - 1.0) < CLOSE
        assert abs(contact[1]) < CLOSE
    assert {reason.split(": ")[1] for reason in locus.stopped} == {"bound reached"}


@pytest.mark.parametrize(("w", "m"), [(1.0, 1), (1.3, 1)])
def test_grazing_locus_from_the_side_without_impacts_is_the_same(w, m):
    form = ImpactOrbit(w, m)
    A = 0.5 * form.A_grazing
    start = [("free", "theta", form.linear_response(A)[1], form.period)]
    free = solve_orbit(systems.impact_oscillator(), {"w": w, "A": A}, start)
    branch = continue_orbit(free, "A", (0.3 * form.A_grazing, 1.1 * form.A_grazing), directions="up")
    locus = continue_locus(branch["GR1"], ("w", "A"), PLANE)
    assert_grazing_locus(locus)


@pytest.mark.parametrize("pair", [("d", "A"), ("e", "A"), ("k", "w"), ("A", "c")])
def test_grazing_locus_in_other_pairs(pair):
    branch = continue_orbit(impact_orbit(1.1, 1, 0.5), "A", (0.01, 12.0))
    limits = {"d": (0.2, 3.0), "e": (0.3, 1.0), "k": (0.5, 2.0), "c": (0.01, 0.4)} | PLANE
    locus = continue_locus(primary(branch, "GR"), pair, {name: limits[name] for name in pair})
    for i in range(len(locus)):
        p = dict(locus.parameters) | dict(zip(pair, locus.values[i], strict=True))
        assert p["A"] == pytest.approx(p["d"] * math.hypot(p["k"] - p["w"] ** 2, p["c"] * p["w"]), abs=CLOSE)
    assert len(locus) > 5


@pytest.mark.parametrize(
    ("w", "m", "kind", "ends"),
    [
        (1.1, 1, "SN", [(1, 2), (1, 1)]),
        (1.4, 1, "SN", [(1, 2), (1, 1)]),
        (0.7, 1, "PD", [(1, 2)]),
        (1.1, 1, "PD", []),
        (2.2, 1, "PD", [(1, 1)]),
        (2.5, 2, "SN", [(1, 1)]),
        (2.5, 2, "PD", []),
    ],
)
def test_fold_and_doubling_loci_are_the_closed_form_and_end_at_the_grazing_locus(w, m, kind, ends):
    start = ImpactOrbit(w, m)
    U = 1.1 * max(0.3, start.U_fold)
    branch = continue_orbit(impact_orbit(w, m, U), "A", (0.01, 6.0))
    locus = continue_locus(primary(branch, kind), ("w", "A"), PLANE)
    for (x, A), orbit in zip(locus.values, locus, strict=True):
        form = ImpactOrbit(x, m)
        speed = form.U_fold if kind == "SN" else form.U_doubling
        assert form.amplitude(speed) == pytest.approx(A, abs=CLOSE)
        assert -orbit.segments[0].state[1] / 0.8 == pytest.approx(speed, abs=CLOSE)
    grazings = places(locus, "GR")
    for end in ends:
        assert any(place == pytest.approx(MEETINGS[end], abs=CLOSE) for place in grazings), (end, grazings)
    for i, reason in zip((0, -1), locus.stopped, strict=True):
        at_end = any(np.allclose(locus.values[i], place, atol=1e-7) for place in grazings)
        wanted = "grazing: orbits beyond it are of another signature" if at_end else "bound reached"
        assert reason.endswith(wanted), reason
    assert locus.admissible[1:-1].all()


def closed_motion(w, m, U):
    """x(t) and v(t) of the orbit with one impact each m periods, t since the impact."""
    form = ImpactOrbit(w, m)
    state = form.after_impact(U)
    A = form.amplitude(U)
    z = A / complex(form.k - w**2, form.c * w)

    def forced(s):
        return np.array([(z * np.exp(1j * s)).real, -w * (z * np.exp(1j * s)).imag])

    start = state[:2] - forced(state[2])
    return lambda t: free_motion(form.k, form.c, t) @ start + forced(state[2] + w * t)


def second_contacts(w, m, U):
    """Local maxima of x between two impacts, in closed form but for the zero of v."""
    motion, period = closed_motion(w, m, U), ImpactOrbit(w, m).period
    grid = np.linspace(0.02, 0.98, 200) * period
    speeds = [motion(t)[1] for t in grid]
    peaks = []
    for i in range(len(grid) - 1):
        if speeds[i] > 0.0 >= speeds[i + 1]:
            t = brentq(lambda t: motion(t)[1], grid[i], grid[i + 1], xtol=1e-15)
            peaks.append(motion(t)[0])
    return peaks


@pytest.mark.campaign
def test_locus_of_a_second_impacts_grazing_is_the_closed_form():
    """Orbit with an impact each two periods: next to it the motion comes back to touch the stop once more."""
    branch = continue_orbit(impact_orbit(2.5, 2, 1.2), "A", (0.01, 12.0))
    second = [
        p
        for p in branch.special_points.of_type("GR")
        if len(p.orbit.signature) == 1 and abs(p.orbit.segments[0].state[1]) > 1e-3
    ]
    assert second
    locus = continue_locus(second[0], ("w", "A"), PLANE)
    assert len(locus) > 5
    for i, (w, A) in enumerate(locus.values):
        table = locus.solution(i).states
        U = -table[np.abs(table[:, 1]).argmax(), 1] / 0.8
        assert ImpactOrbit(w, 2).amplitude(U) == pytest.approx(A, abs=CLOSE)
        assert min(abs(peak - 1.0) for peak in second_contacts(w, 2, U)) < CLOSE


def test_doubling_locus_ends_where_a_second_contact_grazes():
    branch = continue_orbit(impact_orbit(2.5, 2, 1.2), "A", (0.01, 6.0))
    locus = continue_locus(primary(branch, "PD"), ("w", "A"), PLANE)
    ((w, A),) = places(locus, "GR")
    form = ImpactOrbit(w, 2)
    assert form.amplitude(form.U_doubling) == pytest.approx(A, abs=CLOSE)
    assert max(second_contacts(w, 2, form.U_doubling)) == pytest.approx(1.0, abs=CLOSE)


@pytest.mark.campaign
@pytest.mark.parametrize("pair", [("w", "A"), ("w", "c"), ("e", "w"), ("c", "A")])
def test_torus_locus_of_an_oscillator_that_gains_what_impacts_lose(pair):
    """Negative damping: det = e^2 exp(-c T) = 1, and the trace gives the angle."""
    c, e = -0.1, 0.8
    w = math.pi * c / math.log(e)
    branch = continue_orbit(impact_orbit(w + 0.1, 1, 2.5, c=c), "w", (1.2, 1.8), stop_at="TR", directions="down")
    limits = {"w": (1.02, 1.8), "A": (0.1, 12.0), "c": (-0.2, -0.05), "e": (0.7, 0.9)}
    locus = continue_locus(branch["TR1"], pair, {name: limits[name] for name in pair})
    assert len(locus) > 4
    for i, orbit in enumerate(locus):
        p = orbit.parameters
        form = ImpactOrbit(p["w"], 1, c=p["c"], e=p["e"])
        assert form.det == pytest.approx(1.0, abs=CLOSE)
        U = -orbit.segments[0].state[1] / p["e"]
        assert form.amplitude(U) == pytest.approx(p["A"], abs=CLOSE)
        assert 2.0 * math.cos(locus.angle[i]) == pytest.approx(form.trace(U), abs=CLOSE)
    for name, cosine in (("R3", -0.5), ("R4", 0.0)):
        for point in locus.special_points.of_type(name):
            p = point.parameters
            form = ImpactOrbit(p["w"], 1, c=p["c"], e=p["e"])
            assert form.trace(-point.orbit.segments[0].state[1] / p["e"]) == pytest.approx(2 * cosine, abs=CLOSE)


# a contact whose reset moves the state although it has no velocity


def jumping_oscillator():
    return HybridSystem(
        ("x", "v"),
        {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 1.0, "A": 1.0, "shift": 0.2},
        {"free": Mode({"x": "v", "v": "-k*x - c*v + A*cos(theta)"})},
        [Transition("free", "free", "x - d", 1, {"v": "-e*v", "x": "x - shift"}, name="impact")],
        phase=("theta", "w"),
        name="oscillator that jumps off its stop",
    )


@pytest.mark.parametrize("pair", [("w", "A"), ("d", "A"), ("A", "c")])
def test_grazing_locus_of_a_discontinuous_reset_is_the_closed_form(pair):
    form = ImpactOrbit(1.1)
    A = 0.5 * form.A_grazing
    start = [("free", "theta", form.linear_response(A)[1], form.period)]
    free = solve_orbit(jumping_oscillator(), {"w": 1.1, "A": A}, start)
    branch = continue_orbit(free, "A", (0.1, 1.0), directions="up")
    limits = {"d": (0.2, 3.0), "c": (0.01, 0.4)} | PLANE
    locus = continue_locus(branch["GR1"], pair, {name: limits[name] for name in pair})
    assert len(locus) > 5
    assert {reason.split(": ")[1] for reason in locus.stopped} == {"bound reached"}
    for i, orbit in enumerate(locus):
        p = orbit.parameters
        form = ImpactOrbit(p["w"], 1, c=p["c"])
        peak, x0 = form.linear_response(p["A"])
        assert peak == pytest.approx(p["d"], abs=CLOSE)
        np.testing.assert_allclose(orbit.x0, x0, atol=CLOSE)
        np.testing.assert_allclose(np.abs(locus.multipliers[i]), math.exp(-p["c"] * form.period / 2), atol=1e-7)
    assert locus.stable.all()


# other systems


@pytest.mark.parametrize(("e", "n"), [(0.5, 1), (0.8, 2)])
def test_ball_on_a_table_folds_and_doubles_on_curves_in_amplitude_and_restitution(e, n):
    form = TableJump(e, n)
    a = 0.5 * (form.fold + form.doubling)
    start = [("flight", "impact", form.after_impact(a), 2 * math.pi * n)]
    branch = continue_orbit(
        solve_orbit(systems.ball_on_table(), {"e": e, "a": a}, start), "a", (0.5 * form.fold, 1.2 * form.doubling)
    )
    bounds = {"a": (0.01, 6.0), "e": (0.05, 0.95)}
    for label, name in (("SN1", "fold"), ("PD1", "doubling")):
        locus = continue_locus(branch[label], ("a", "e"), bounds)
        wanted = [getattr(TableJump(value, n), name) for value in locus.column("e")]
        np.testing.assert_allclose(locus.column("a"), wanted, atol=CLOSE)
        assert sorted(locus.column("e")[[0, -1]]) == pytest.approx([0.05, 0.95], abs=1e-12)
        assert_points(locus, {})
        assert_critical(locus)
        for orbit in locus:
            assert np.prod(orbit.multipliers).real == pytest.approx(orbit.parameters["e"] ** 2, abs=CLOSE)
        if label == "PD1":
            np.testing.assert_array_equal(locus.stable, True)


def strength(r, be, ga=1.5):
    """al for which an orbit of the two planar fields leaves the right half plane at radius r (see two_fields_orbit)."""
    E = math.exp(math.pi)

    def angle(x):
        return ((ga + be) * math.log(x) - ga * math.log(abs(be - x))) / be

    return (angle(r) - angle(r * E / (1.0 + r * (E - 1.0)))) / math.pi


def critical_radius(be, guess):
    """Where `strength` has an extremum: a fold of orbits."""

    def slope(r):
        h = 1e-4
        one, two = (strength(r + k * h, be) - strength(r - k * h, be) for k in (1, 2))
        return (8.0 * one - two) / (12.0 * h)

    return brentq(slope, 0.97 * guess, 1.03 * guess, xtol=1e-14)


def test_folds_of_two_planar_fields_are_extrema_of_the_closed_form():
    be = 0.8
    r = critical_radius(be, 2.1154)
    fold = strength(r, be)
    for share in (0.97, 1.03):
        start = share * r
        E = math.exp(math.pi)
        end = start * E / (1.0 + start * (E - 1.0))
        segments = [("left", "to_right", [0.0, start], math.pi), ("right", "to_left", [0.0, -end], 2.5)]
        orbit = solve_orbit(systems.two_fields(), {"al": strength(start, be), "be": be}, segments)
        branch = continue_orbit(orbit, "al", (fold - 0.1, fold + 0.1))
        assert branch["SN1"].parameters["al"] == pytest.approx(fold, abs=CLOSE)
    locus = continue_locus(branch["SN1"], ("al", "be"), {"al": (-2.0, 0.0), "be": (0.5, 1.2)})
    assert len(locus) > 5
    for i, (al, value) in enumerate(locus.values):
        guess = abs(locus.unknowns[i][1])
        guess = guess if locus.signature(i)[0][0] == "left" else abs(locus.unknowns[i][locus.forms[0].turns + 4])
        assert strength(critical_radius(value, guess), value) == pytest.approx(al, abs=CLOSE)
    assert_critical(locus)


def test_a_limit_cycle_that_grows_touches_a_wall_at_its_radius():
    """r' = (mu - r^2) r, one turn in 2 pi: an autonomous closed orbit of radius sqrt(mu)."""
    square = "(x**2 + y**2)"
    system = HybridSystem(
        ("x", "y"),
        {"mu": 1.0, "d": 1.2, "e": 0.7},
        {"m": Mode({"x": f"(mu - {square})*x - y", "y": f"x + (mu - {square})*y"})},
        [Transition("m", "m", "x - d", 1, {"y": "-e*y"}, name="wall")],
    )
    orbit = solve_orbit(system, {}, [("m", None, [1.0, 0.1], 6.28)])
    branch = continue_orbit(orbit, "mu", (0.5, 3.0))
    assert branch["GR1"].parameters["mu"] == pytest.approx(1.44, abs=CLOSE)
    locus = continue_locus(branch["GR1"], ("mu", "d"), {"mu": (0.2, 4.0), "d": (0.2, 3.0)})
    np.testing.assert_allclose(locus.column("mu"), locus.column("d") ** 2, atol=CLOSE)
    assert sorted(locus.column("mu")[[0, -1]]) == pytest.approx([0.2, 4.0], abs=1e-12)
    np.testing.assert_allclose(locus.period, 2.0 * math.pi, atol=CLOSE)


# what a locus is as a result


@pytest.fixture(scope="module")
def torus(delayed):
    branch = continue_orbit(cycle(delayed, [(1 / 3, 1 / 3)]), "a", (1.2, 4.0))
    return continue_locus(branch["TR1"], ("c", "a"), BOX)


@pytest.mark.campaign
def test_a_saved_locus_comes_back_equal(torus, tmp_path):
    torus.save(tmp_path / "locus.nc")
    for back in (type(torus).load(tmp_path / "locus.nc"), load_result(tmp_path / "locus.nc")):
        assert type(back) is type(torus)
        assert (back.type, back.names, back.stopped) == (torus.type, torus.names, torus.stopped)
        assert dict(back.parameters) == dict(torus.parameters)
        for name in (
            "values",
            "x0",
            "multipliers",
            "angle",
            "coefficient",
            "period",
            "arclength",
            "stable",
            "residual",
        ):
            np.testing.assert_array_equal(getattr(back, name), getattr(torus, name), err_msg=name)
        assert [(p.label, p.of, p.locus, p.varied) for p in back.special_points] == [
            (p.label, p.of, p.locus, p.varied) for p in torus.special_points
        ]
        assert back.options == torus.options
        again = continue_locus(back["R3_1"], ("c", "a"), BOX)
        assert places(again, "R4") == [pytest.approx((1.0, 3.0), abs=CLOSE)]


def test_a_locus_as_a_dataset_names_its_columns(torus):
    data = torus.to_xarray()
    np.testing.assert_array_equal(data["c"], torus.values[:, 0])
    np.testing.assert_array_equal(data["angle"], torus.angle)
    assert data.attrs["type"] == "TR"
    assert set(data["special_type"].values) == {"R1", "R2", "R3", "R4"}
    frame = torus.special_points.to_dataframe()
    assert set(frame["label"]) == {"R1_1", "R2_1", "R3_1", "R4_1"}


def test_a_locus_can_be_drawn(torus):
    import matplotlib as mpl

    mpl.use("Agg")
    assert torus.plot() is not None


@pytest.mark.parametrize(("directions", "first", "last"), [("up", 2.5, 3.0), ("down", -1.0, 2.5)])
def test_directions_are_those_of_the_second_parameter(delayed, directions, first, last):
    start = cycle(delayed, [(1 - 1 / 4.5, 1 - 1 / 4.5)], a=4.5, c=2.5)
    locus = continue_locus(start, ("a", "c"), BOX, type="TR", directions=directions)
    c = locus.column("c")
    assert locus.stopped[0] == "the start"
    assert c[0] == pytest.approx(2.5, abs=CLOSE)
    assert (c.min(), c.max()) == pytest.approx((first, last), abs=CLOSE)


@pytest.mark.parametrize("stop", ["R4", ("R4", "R3")])
def test_stop_at_ends_the_locus_there(delayed, stop):
    start = cycle(delayed, [(1 - 1 / 2.2, 1 - 1 / 2.2)], a=2.2, c=0.2)
    locus = continue_locus(start, ("a", "c"), BOX, type="TR", stop_at=stop, directions="up")
    assert locus.values[-1] == pytest.approx((3.0, 1.0), abs=CLOSE)
    assert locus.stopped[1].endswith(": R4")


def test_a_closed_locus_is_traced_once():
    """Folds of x -> x + k (1 - x^2 - p^2 - q^2) in (p, q): x = 0 on the unit circle."""
    system = carried({"x": "x + k*(1 - (x - 2)**2 - p**2 - q**2/4)"}, p=0.0, q=0.6, k=0.4)
    branch = continue_orbit(cycle(system, [2.0 + math.sqrt(1.0 - 0.09)]), "p", (-2.0, 2.0))
    for directions in ("both", "up", "down"):
        locus = continue_locus(branch["SN1"], ("p", "q"), {"p": (-3.0, 3.0), "q": (-3.0, 3.0)}, directions=directions)
        assert locus.stopped == ("the locus is closed", "the locus is closed")
        p, q = locus.values.T
        np.testing.assert_allclose(p**2 + q**2 / 4.0, 1.0, atol=CLOSE)
        turns = np.unwrap(np.arctan2(q / 2.0, p))
        assert np.ptp(turns) == pytest.approx(2.0 * math.pi, abs=1e-9)
        turning = [(point.of, *point.parameters.values()) for point in locus.special_points.of_type("TP")]
        assert sorted(row[0] for row in turning) == ["p", "p", "q", "q"]
        got = [(round(x), round(y)) for x, y in places(locus, "TP")]
        assert sorted(got) == [(-1, 0), (0, -2), (0, 2), (1, 0)]
        np.testing.assert_allclose(places(locus, "TP"), got, atol=CLOSE)


@pytest.mark.parametrize("q", [1e-3, 0.02, -0.02, 0.1, 1.9, -1.99])
def test_a_closed_locus_has_each_special_point_once_wherever_it_starts(q):
    system = carried({"x": "x + k*(1 - (x - 2)**2 - p**2 - q**2/4)"}, p=0.0, q=q, k=0.4)
    branch = continue_orbit(cycle(system, [2.0 + math.sqrt(1.0 - q**2 / 4.0)]), "p", (-2.0, 2.0))
    for label in ("SN1", "SN2"):
        locus = continue_locus(branch[label], ("p", "q"), {"p": (-3.0, 3.0), "q": (-3.0, 3.0)})
        assert locus.stopped == ("the locus is closed", "the locus is closed")
        assert sorted((round(x), round(y)) for x, y in places(locus, "TP")) == [(-1, 0), (0, -2), (0, 2), (1, 0)]


def test_an_interrupt_ends_a_locus_with_what_was_found(delayed):
    def interrupt(progress):
        assert progress.total is None
        assert re.fullmatch(r"a = [\d.]+, c = -?[\d.]+", progress.text)
        if progress.done == 5:
            raise KeyboardInterrupt

    start = cycle(delayed, [(1 - 1 / 2.2, 1 - 1 / 2.2)], a=2.2, c=0.2)
    locus = continue_locus(start, ("a", "c"), BOX, type="TR", progress=interrupt)
    assert "interrupted" in locus.stopped
    assert len(locus) >= 5
