"""Means, harmonics and extremes of expressions with kinks, jumps, poles and peaks, on x = sin t, y = cos t."""

import math
import random
import warnings

import numpy as np
import pytest
from scipy.special import ive, jv

import saltus
from saltus.flow.observables import Estimate
from selection import guarding


@pytest.fixture(scope="module")
def circle():
    """x = sin t, v = cos t: x'' = -x - x' + cos t has the solution for any start, at last."""
    system = saltus.HybridSystem.smooth({"x": "v", "v": "-x-v+cos(s)"}, {}, phase=("s", "1"))
    orbit = saltus.find_orbit(system, x0=[0.0, 1.0])
    motion = saltus.simulate(system, None, [0.0, 1.0], periods=4)
    return orbit, motion


def _pole(a):
    return 1.0 / (a * a - 1.0) ** 0.5


CLOSED = {
    "1/(1.0001-x)**2": 1.0001 / (1.0001**2 - 1.0) ** 1.5,
    "1/(1.001-x)": _pole(1.001),
    "exp(300*(x-1))": float(ive(0, 300)),
    "sign(x-0.5)": -1.0 / 3.0,
    "abs(x)": 2.0 / math.pi,
    "(abs(x-0.99)+x-0.99)/2": (math.sin(math.acos(0.99)) - 0.99 * math.acos(0.99)) / math.pi,
    "log(abs(x))": -math.log(2.0),
    "x**100": math.comb(100, 50) / 2**100,
    "cos(1000*x)": float(jv(0, 1000)),
    "Max(x, v)": math.sqrt(2.0) / math.pi,
    "1/sqrt(abs(x))": math.gamma(0.25) / (math.sqrt(math.pi) * math.gamma(0.75)),
    "sin(x)/x": float(np.mean([math.sin(math.sin(a)) / math.sin(a) for a in (np.arange(64) + 0.5) * math.pi / 32])),
}


@pytest.mark.parametrize("expression", CLOSED)
def test_means_are_those_of_the_closed_forms_within_the_errors_told(circle, expression):
    for motion in circle:
        (found,) = motion.observe(f"mean({expression})", errors=True).values()
        assert isinstance(found, Estimate)
        assert abs(found.value - CLOSED[expression]) <= found.error
        assert found.error <= 1e-4 * abs(CLOSED[expression])  # the bound at the pole of an inverse root is wide


@pytest.mark.parametrize("expression", ["1/x", "1/x**2", "1/abs(x)", "tan(2*x)"])
def test_a_mean_that_does_not_converge_is_nan_and_named(circle, expression):
    for motion in circle:
        with pytest.warns(RuntimeWarning, match=r"mean\(.*\) is NaN: the integral does not converge"):
            assert math.isnan(motion.observe(f"mean({expression})")[f"mean({expression})"])


def test_a_mean_without_a_value_on_part_of_the_motion_is_nan_and_named(circle):
    with pytest.warns(RuntimeWarning, match=r"mean\(log\(x\)\) is NaN: the expression has no value on a part"):
        assert math.isnan(circle[0].observe("mean(log(x))")["mean(log(x))"])


@pytest.mark.parametrize("width", guarding((1e1, 1e3, 1e4, 1e6), 1e4))
def test_a_narrow_peak_is_found_by_orbit_column_and_motion_alike(width):
    outputs = {"o": f"exp(-((x-0.3)*{width})**2)", "lor": f"1/(1+((x-0.3)*{width})**2)"}
    system = saltus.HybridSystem.smooth({"x": "v", "v": "mu*(1-x**2)*v-x"}, {"mu": 1.0}, outputs=outputs)
    orbit = saltus.find_orbit(system, x0=[2.0, 0.0])
    branch = saltus.continue_orbit(orbit, "mu", (0.9, 1.1))
    motion = saltus.simulate(system, None, [2.0, 0.0], t_end=20.0)
    for name in outputs:
        assert orbit.max[name] == orbit.observe(f"max({name})")[f"max({name})"] == pytest.approx(1.0, abs=1e-9)
        assert motion.observe(f"max({name})")[f"max({name})"] == pytest.approx(1.0, abs=1e-9)
        assert branch.column(f"max_{name}") == pytest.approx(1.0, abs=1e-9)
        assert np.array_equal(branch.column(f"max_{name}"), branch.column(f"max({name})"))


def test_the_mean_of_a_branch_is_that_of_its_orbits_with_an_error():
    system = saltus.HybridSystem.smooth(
        {"x": "v", "v": "-x-v+A*cos(s)"}, {"A": 1.0}, phase=("s", "1"), outputs={"k": "abs(x - 0.3)"}
    )
    branch = saltus.continue_orbit(saltus.find_orbit(system, x0=[0.0, 1.0]), "A", (0.9, 1.3))
    told = branch.observe("mean(k)", "amplitude(x, 1)", errors=True)
    for A, value, error in zip(branch.values, told["mean(k)"].values, told["error of mean(k)"].values, strict=True):
        a = math.asin(0.3 / A)
        truth = (0.6 * a + 2.0 * A * math.cos(a)) / math.pi
        assert abs(value - truth) <= max(error, 1e-13)
        assert error < 1e-9
    assert told["amplitude(x, 1)"].values == pytest.approx(branch.values, rel=1e-10)
    assert np.all(told["error of amplitude(x, 1)"].values < 1e-9)


def test_a_pole_has_no_greatest_value_and_a_removable_one_does(circle):
    orbit = circle[0]
    assert orbit.observe("max(1/abs(x))", "min(log(abs(x)))") == {
        "max(1/abs(x))": math.inf,
        "min(log(abs(x)))": -math.inf,
    }
    assert orbit.observe("max(sin(x)/x)")["max(sin(x)/x)"] == pytest.approx(1.0, abs=1e-12)


_KINDS = ("kink", "jump", "peak", "wave", "pole", "largest", "power", "smooth")


def _expression(number: int) -> str:
    """Return a random expression with a kink, jump or peak, in x and v."""
    pick = random.Random(f"observed {number}")
    a, b = round(pick.uniform(-0.9, 0.9), 3), round(pick.uniform(-1.0, 1.0), 3)
    narrow, order = round(10.0 ** pick.uniform(0.0, 3.5), 3), pick.choice((1, 2, 3))
    inner = pick.choice((f"x-({a})", f"v-({a})", f"x*v-({0.5 * a})", f"x+({b})*v-({a})", f"x**2-({abs(a)})"))
    outer = pick.choice(("1", "1", "x", "v", f"(1+({b})*x)", "exp(v)"))
    kind = pick.choice(_KINDS)
    text = {
        "kink": f"abs({inner})**{order}" if order != 2 else f"abs({inner})",
        "jump": f"sign({inner})",
        "peak": pick.choice((f"exp(-(({inner})*{narrow})**2)", f"1/(1+(({inner})*{narrow})**2)")),
        "wave": f"cos({min(narrow, 300)}*({inner}))",
        "pole": f"1/({round(1.0 + 1.0 / narrow, 6)}-{pick.choice('xv')})**{order}",
        "largest": f"{pick.choice(('Max', 'Min'))}({inner}, ({b})*v)",
        "power": f"sqrt(abs({inner}))",
        "smooth": f"tanh({min(narrow, 50)}*({inner}))",
    }[kind]
    return f"{outer}*{text}"


def _truth(expression: str) -> float:
    """Return the mean over t of the expression at x = sin t, v = cos t, by Gauss's rule between graded places."""
    ends = np.array(_cuts(expression))
    roots, weights = np.polynomial.legendre.leggauss(24)
    half = 0.5 * np.diff(ends)
    places = ends[:-1, None] + half[:, None] * (1.0 + roots)
    values = _at(expression, places)
    return math.fsum((half[:, None] * weights * values).ravel()) / (2.0 * math.pi)


def _at(expression: str, t):
    known = {"x": np.sin(t), "v": np.cos(t), "abs": np.abs, "sign": lambda h: np.copysign(1.0, h), "exp": np.exp,
             "cos": np.cos, "tanh": np.tanh, "sqrt": np.sqrt, "Max": np.maximum, "Min": np.minimum}  # fmt: skip
    return eval(expression, known) * np.ones_like(t)


def _cuts(expression: str) -> list[float]:
    """Return where to cut the circle: graded about the roots of what is within the function, and their order."""
    import ast

    roots: list[float] = []
    tree = ast.parse(expression, mode="eval")
    t = np.linspace(0.0, 2.0 * math.pi, 4001)
    for node in ast.walk(tree):
        inner = None
        if isinstance(node, ast.Call) and node.func.id in ("Max", "Min"):
            inner = f"({ast.unparse(node.args[0])})-({ast.unparse(node.args[1])})"
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Sub):
            inner = ast.unparse(node)
        if inner is None:
            continue
        code = compile(inner, "inner", "eval")
        height = lambda s: eval(code, {"x": np.sin(s), "v": np.cos(s), "exp": np.exp})  # noqa: B023, E731
        values = height(t) * np.ones_like(t)
        for i in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) <= 0.0):
            low, high = t[i], t[i + 1]
            for _ in range(200):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if height(low) * height(middle) > 0 else (low, middle)
            roots.append(0.5 * (low + high))
        roots += [float(t[int(np.argmin(np.abs(values)))])]
    graded = {0.0, 2.0 * math.pi, *np.linspace(0.0, 2.0 * math.pi, 513)}
    for root in roots:
        graded |= {root} | {root + side * 2.0**-k for side in (-1.0, 1.0) for k in range(1, 46)}
    return sorted(place for place in graded if 0.0 <= place <= 2.0 * math.pi)


@pytest.mark.parametrize("number", guarding(range(300), *range(0, 12), campaign=24))
def test_the_error_of_a_random_mean_holds(circle, number):
    expression = _expression(number)
    truth = _truth(expression)
    for motion in circle:
        found = motion.observe(f"mean({expression})", errors=True)[f"mean({expression})"]
        assert abs(found.value - truth) <= found.error + 1e-15, (expression, found, truth)
        assert found.error <= 1e-5 * max(1.0, _truth(f"abs({expression})")), (expression, found)


@pytest.mark.parametrize("number", guarding(range(300), *range(0, 12), campaign=24))
def test_random_extremes_are_those_of_a_fine_grid_or_beyond(circle, number):
    expression = _expression(number)
    t = np.unique(np.concatenate([np.linspace(0.0, 2.0 * math.pi, 200_001), np.asarray(_cuts(expression))]))
    values = _at(expression, t)
    for motion in circle:
        found = motion.observe(f"max({expression})", f"min({expression})", errors=True)
        high, low = found.values()
        slack = 1e-9 * max(1.0, np.ptp(values))
        assert high.value >= values.max() - high.error - slack, (expression, high, values.max())
        assert low.value <= values.min() + low.error + slack, (expression, low, values.min())


def test_no_warning_without_a_reason(circle):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        circle[0].observe("mean(x**2)", "max(sin(3*x))", "amplitude(abs(x), 2)", "phase(x, 1)", errors=True)


def test_bounds_that_are_infinite_on_both_sides_tell_no_width():
    """On a sawtooth x = t the logarithm's pole lies on a step's end: the mean is c log c + (1 - c) log(1 - c) - 1."""
    back = saltus.Transition("m", "m", "x - 1", 1, {"x": "0", "y": "1"})
    saw = saltus.HybridSystem(("x", "y"), {}, {"m": saltus.Mode({"x": "1", "y": "-y"})}, [back])
    c, orbit = 0.936, saltus.find_orbit(saw, x0=[0.0, 1.0])
    (found,) = orbit.observe(f"mean(log(abs(x - {c})))", errors=True).values()
    assert abs(found.value - (c * math.log(c) + (1 - c) * math.log(1 - c) - 1)) <= found.error
