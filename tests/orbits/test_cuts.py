"""Long smooth orbits, cut where they are sensitive: multipliers against closed forms, SciPy and mpmath."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import fsolve

import saltus
from saltus.orbits.cuts import whole
from saltus.orbits.signature import CUT_END
from saltus.orbits.stability.floquet import _of_product, multipliers
from selection import guarding

# A Shilnikov orbit's neighbourhood: its cycles' periods grow by 5.01 from one period doubling to the next.
CIRCUIT = saltus.HybridSystem(
    ("x", "y", "z"),
    {"nu": -0.6},
    {
        "m": saltus.Mode(
            {
                "x": "(-(0.5 + nu)*x + 0.5*y - 0.328578*x**3 + 0.933578*(y - x)**3)/0.6",
                "y": "0.5*x + 0.1*y - z - 0.933578*(y - x)**3",
                "z": "y",
            }
        )
    },
)
# Two uncoupled linear oscillators of first order: the multipliers are exp(2 pi a / w) and exp(2 pi b / w).
LINEAR = saltus.HybridSystem(
    ("x", "y"),
    {"a": 2.0, "b": -3.0, "w": 1.0, "size": 1.0},
    {"m": saltus.Mode({"x": "a*x + size*cos(s)", "y": "b*y + size*sin(s)"})},
    phase=("s", "w"),
)


def slope(y: np.ndarray, nu: float) -> np.ndarray:
    """The circuit's field with that of the variations behind it, written anew."""
    a, b, c = y[:3]
    d = b - a
    bend = 3 * 0.933578 * d * d
    jacobian = np.array(
        [
            [(-(0.5 + nu) - 3 * 0.328578 * a * a - bend) / 0.6, (0.5 + bend) / 0.6, 0.0],
            [0.5 + bend, 0.1 - bend, -1.0],
            [0.0, 1.0, 0.0],
        ]
    )
    cube = 0.933578 * d**3
    field = [(-(0.5 + nu) * a + 0.5 * b - 0.328578 * a**3 + cube) / 0.6, 0.5 * a + 0.1 * b - c - cube, b]
    return np.concatenate([field, (jacobian @ y[3:12].reshape(3, 3)).ravel(), [np.trace(jacobian)]])


def by_scipy(orbit: saltus.results.PeriodicOrbit) -> tuple[list[float], float]:
    """The two multipliers and the integrated divergence of a cycle of the circuit, from SciPy's flow in pieces."""
    nu, pieces, divergence = orbit.parameters["nu"], [], 0.0
    for state, duration in zip(orbit.states, orbit.durations, strict=True):
        for _ in range(4):
            begin = np.concatenate([state, np.eye(3).ravel(), [0.0]])
            y = solve_ivp(
                lambda t, y: slope(y, nu), (0.0, duration / 4), begin, method="DOP853", rtol=3e-14, atol=1e-15
            ).y[:, -1]
            pieces.append((state, y[3:12].reshape(3, 3)))
            divergence += y[12]
            state = y[:3]
    frames = []
    for state, _ in pieces:
        field = slope(np.concatenate([state, np.zeros(9)]), nu)[:3]
        frames.append(np.linalg.qr(np.column_stack([field, np.eye(3)[:, :2]]))[0])
    with mpmath.workdps(60):
        product = mpmath.eye(2)
        for k, (_, matrix) in enumerate(pieces):
            turned = frames[(k + 1) % len(pieces)].T @ matrix @ frames[k]
            product = mpmath.matrix(turned[1:, 1:].tolist()) * product
        values = sorted(mpmath.eig(product)[0], key=abs, reverse=True)
        return [float(mpmath.re(value)) for value in values], divergence


def by_arc(point: saltus.results.SpecialPoint) -> float:
    return point.arclength


def half_turn(nu: float) -> float:
    """Return half of the period of oscillations about the equilibrium to which the homoclinic orbit leads."""
    rest = fsolve(lambda at: slope(np.concatenate([at, np.zeros(10)]), nu)[:3], [0.5, 0.0, 0.3])
    jacobian = slope(np.concatenate([rest, np.eye(3).ravel(), [0.0]]), nu)[3:12].reshape(3, 3)
    return math.pi / float(np.abs(np.linalg.eigvals(jacobian).imag).max())


@pytest.fixture(scope="module")
def circuit() -> saltus.results.Branch:
    orbit = saltus.find_orbit(CIRCUIT, {}, x0=[0.1, 0.1, 0.1])
    return saltus.continue_orbit(orbit, "nu", (-0.9, -0.4), directions="down")


# What errors of 1e-13 a step make in the multipliers grows with the period, sixteenfold from one doubling to the next.
@pytest.mark.campaign
@pytest.mark.parametrize(("number", "error"), guarding([(5, 1e-6), (6, 1e-6), (7, 3e-5)], (6, 1e-6), campaign=0))
def test_multipliers_of_a_long_cycle_are_those_of_scipy(
    circuit: saltus.results.Branch, number: int, error: float
) -> None:
    orbit = circuit[f"PD{number}"].orbit
    assert len(orbit.form) > 1
    values, divergence = by_scipy(orbit)
    assert abs(orbit.multipliers[0] + 1.0) < 1e-6
    assert orbit.multipliers[:2].real == pytest.approx(values, rel=error, abs=0.0)
    assert math.log(abs(np.prod(orbit.multipliers))) == pytest.approx(divergence, rel=1e-8)
    assert orbit.residual < 1e-12


@pytest.mark.campaign
def test_each_turn_next_to_a_shilnikov_orbit_has_its_saddle_node_and_its_doubling(circuit) -> None:
    """Glendinning and Sparrow: the periods of the turns grow by half of one of the saddle-focus in the end."""
    points = sorted([*circuit.special_points.of_type("SN"), *circuit.special_points.of_type("PD")], key=by_arc)
    assert "".join(point.type[0] for point in points) == "P" + "PSSP" * 8
    folds = [point for point in points if point.type == "SN"]
    gaps = np.diff([point.orbit.period for point in folds])
    assert gaps[-6:] == pytest.approx(half_turn(folds[-1].orbit.parameters["nu"]), rel=2e-7)
    assert not circuit.audit.breaches
    assert not circuit.audit.remarks


@pytest.mark.campaign
def test_multipliers_keep_their_digits_as_the_period_grows_to_that_of_the_homoclinic_orbit(circuit) -> None:
    points = sorted([*circuit.special_points.of_type("SN"), *circuit.special_points.of_type("PD")], key=by_arc)
    for point, rel in zip(points[-2:], (3e-4, 3e-4), strict=True):
        # rounding alone leaves hundreds of the multiplier that passes
        assert point.orbit.multipliers[0] == {"SN": 1.0, "PD": -1.0}[point.type]
        assert math.log(abs(np.prod(point.orbit.multipliers))) == pytest.approx(by_scipy(point.orbit)[1], rel=rel)
    assert np.all(circuit.residual < 1e-10)
    assert "the period grows without bound" in circuit.stopped[1]


@pytest.mark.campaign
def test_a_cut_cycle_looks_like_one_segment(circuit: saltus.results.Branch, tmp_path) -> None:
    orbit = circuit["PD6"].orbit
    assert orbit.signature == (("m", ""),)
    (segment,) = orbit.segments
    assert segment.duration == pytest.approx(orbit.period, rel=1e-15)
    assert np.all(np.diff(orbit.sample(400)["t"].values) > 0.0)
    orbit.save(tmp_path / "orbit.nc")
    again = saltus.load(tmp_path / "orbit.nc")
    assert again.form == orbit.form
    assert np.array_equal(again.multipliers, orbit.multipliers)
    assert len(circuit.signature(-1)) == 1


@pytest.mark.campaign
def test_the_survey_of_a_cut_cycle_is_that_of_the_whole_one(circuit: saltus.results.Branch) -> None:
    orbit = circuit["SN4"].orbit
    problem, u = whole(orbit.problem(), orbit.unknowns)
    survey = problem.survey(u)
    assert CUT_END not in problem.signature.kinds
    # the whole one magnifies its start's rounding by 1e3
    assert orbit.lows == pytest.approx(survey.lows, abs=1e-9)
    assert orbit.highs == pytest.approx(survey.highs, abs=1e-9)


@pytest.mark.parametrize(("w", "size"), [(1.0, 1.0), (1e6, 1e-9), (1e-3, 1e6)])
def test_multipliers_of_a_forced_orbit_are_exact_in_any_units(w: float, size: float) -> None:
    a, b = 2.0 * w, -3.0 * w
    values = {"a": a, "b": b, "w": w, "size": size}
    period = 2.0 * math.pi / w
    # x = size (w sin s - a cos s) / (a^2 + w^2) and y = size (-b sin s - w cos s) / (b^2 + w^2)
    start = [-a * size / (a * a + w * w), -w * size / (b * b + w * w)]
    orbit = saltus.solve_orbit(LINEAR, values, [("m", None, start, period)])
    assert len(orbit.form) > 1
    assert orbit.signature == (("m", "s"),)
    assert orbit.x0 == pytest.approx(start, rel=1e-10)
    expected = [math.exp(a * period), math.exp(b * period)]
    assert np.array(orbit.multipliers) == pytest.approx(expected, rel=1e-8)


def test_eigenvalues_of_a_product_are_right_over_forty_powers_of_ten() -> None:
    rng = np.random.default_rng(4)
    sizes = np.diag([10.0, 8.0, 1.0, 0.3, 1e-3])
    for _ in range(5):
        blocks = np.array([np.linalg.qr(rng.normal(size=(5, 5)))[0] @ sizes for _ in range(14)])
        with mpmath.workdps(80):
            product = mpmath.eye(5)
            for block in blocks:
                product = mpmath.matrix(block.tolist()) * product
            exact = sorted((complex(v) for v in mpmath.eig(product)[0]), key=abs, reverse=True)
        found = _of_product(blocks)
        assert abs(found[0]) / abs(found[-1]) > 1e30
        for value in exact:
            assert min(abs(value - other) for other in found) < 1e-9 * abs(value)


def test_whole_and_cut_multipliers_agree_where_both_have_digits() -> None:
    orbit = saltus.solve_orbit(LINEAR, {}, [("m", None, [-0.4, -0.1], 2.0 * math.pi)])
    problem, u = whole(orbit.problem(), orbit.unknowns)
    values = multipliers(problem, u, problem.evaluate(u)[1])
    assert orbit.multipliers[0] == pytest.approx(values[0], rel=1e-9)
    rate = quad(lambda s: orbit.parameters["a"], 0.0, 2.0 * math.pi)[0]
    assert math.log(values[0].real) == pytest.approx(rate, rel=1e-10)
