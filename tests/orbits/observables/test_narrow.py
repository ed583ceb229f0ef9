"""Observables with peaks, kinks and jumps as fits take them: value and derivatives by the door of `sensitivity`.

The orbit is x = A sin(s) in closed form, whatever the tolerance; means of f(x) are integrals over the circle.
"""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
import sympy

import saltus
from saltus import HybridSystem, Mode, Transition
from selection import guarding

A, W, C = 0.8, 1.3, 0.3
NAMES = ("A", "c", "d")


def follower(outputs: dict, tolerance: float, d: float, modes: tuple[str, ...] = ("all",), events: tuple = ()):
    """An orbit x = A sin(s); the modes differ in their outputs alone."""
    field = {"x": "w*A*cos(s) - (x - A*sin(s))"}
    system = HybridSystem(
        ("x",), {"A": A, "w": W, "c": C, "d": d}, {name: Mode(field) for name in modes}, list(events),
        phase=("s", "w"), outputs=outputs,
    )  # fmt: skip
    if not events:
        return saltus.solve_orbit(system, x0=[0.0], period=2.0 * math.pi / W, tolerance=tolerance)
    return saltus.find_orbit(system, x0=[0.0], tolerance=tolerance)


def expression(number: int) -> tuple[str, float]:
    """Return a random f(x) in A, c and d, with its narrowest place at x = c or x = A, and d."""
    pick = random.Random(f"narrow {number}")
    d = round(10.0 ** pick.uniform(0.3, 2.3), 3)
    kinds = (
        "1/(1 + (d*(x - c))**2)", "exp(-(d*(x - c))**2)", "tanh(d*(x - c))", "sin(d*x)", "1/(A*(1 + 1/d) - x)",
        "abs(x - c)", "Max(x, c)", "Min(x**2, c)", "abs(x - c)*exp(x)", "log(A*(1 + 1/d) + x)", "exp(3*x)/(2 + x)",
        "Max(d*(x - c), 0)**2", "x*Max(x, c*x)", "sqrt(1 + d*x**2)", "cos(d*(x - c)**2)",
    )  # fmt: skip
    return kinds[number % len(kinds)], d


def means(text: str, d: float, order: int) -> tuple[complex, dict[str, complex]]:
    """Return the mean of f, or 2i times that of f e^(-i order s), and its derivatives, by SymPy and graded places."""
    x, s = sympy.Symbol("x", real=True), sympy.Symbol("s", real=True)
    symbols = {name: sympy.Symbol(name, real=True) for name in NAMES}
    f = sympy.sympify(text, locals={"x": x, "abs": sympy.Abs, **symbols})
    at = {symbols["A"]: A, symbols["c"]: C, symbols["d"]: d}
    total = f.subs(x, symbols["A"] * sympy.sin(s))
    wanted = [total, *(sympy.diff(total, symbols[name]) for name in NAMES)]
    functions = [sympy.lambdify(s, one.subs(at), [{"Heaviside": lambda h, *_: np.heaviside(h, 0.5)}, "numpy"])
                 for one in wanted]  # fmt: skip
    roots = {0.5 * math.pi, 1.5 * math.pi, math.asin(C / A), math.pi - math.asin(C / A), 0.0, math.pi}
    small = math.asin(math.sqrt(C) / A)
    roots |= {small, math.pi - small, math.pi + small, 2.0 * math.pi - small}
    cuts = {*np.linspace(0.0, 2.0 * math.pi, 257)}
    for root in roots:
        cuts |= {root} | {root + side * 2.0**-k for side in (-1.0, 1.0) for k in range(1, 46)}
    ends = np.array(sorted(place for place in cuts if 0.0 <= place <= 2.0 * math.pi))
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.5 * np.diff(ends)
    places = ends[:-1, None] + half[:, None] * (1.0 + nodes)
    wave = (1.0 if not order else 2j * np.exp(-1j * order * places)) * half[:, None] * weights / (2.0 * math.pi)
    value, *slopes = (complex(np.sum(wave * function(places) * np.ones_like(places))) for function in functions)
    return value, dict(zip(NAMES, slopes, strict=True))


@pytest.mark.parametrize("tolerance", [1e-12, 1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("number", guarding(range(90), *range(15), campaign=30))
def test_values_and_derivatives_are_those_of_the_closed_form(number, tolerance):
    text, d = expression(number)
    orbit = follower({"o": text}, tolerance, d)
    names = ["mean(o)", "amplitude(o, 1)", "amplitude(o, 2)"]
    found, seen = orbit.sensitivity(names, NAMES), orbit.observe(*names, errors=True)
    for order, name in enumerate(names):
        value, slopes = means(text, d, order)
        error = seen[name].error
        assert abs(found[name].attrs["value"] - abs(value) * (1.0 if order else np.sign(value.real))) <= error, name
        assert abs(found[name].attrs["value"] - seen[name].value) <= error, name
        if order and abs(value) < 1e-6:  # no direction in which the harmonic grows
            continue
        for p in NAMES:
            by = slopes[p].real if not order else (slopes[p] * np.conj(value)).real / abs(value)
            largest = max(abs(by), abs(value), d * A)  # the states' errors are magnified by the slope
            assert found[name].sel(parameter=p).item() == pytest.approx(
                by, abs=max(1e-8, 1e3 * tolerance) * largest * d
            )


@pytest.mark.parametrize("tolerance", [1e-12, 1e-9, 1e-7, 1e-5])
def test_a_narrow_peak_is_the_greatest_value(tolerance):
    orbit = follower({"o": "exp(-(d*(x - c))**2)*(1 + c)"}, tolerance, 50.0)
    found = orbit.sensitivity(["max(o)"], NAMES)["max(o)"]
    assert found.attrs["value"] == pytest.approx(1.0 + C, rel=1e-9)
    np.testing.assert_allclose(found, [0.0, 1.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("tolerance", [1e-12, 1e-9, 1e-7, 1e-5])
def test_outputs_that_differ_from_mode_to_mode_are_cut_at_the_segments(tolerance):
    """Where x is above c the output is 1 + x, else 0: it jumps where x = c, which parameters move."""
    events = (
        Transition("low", "high", "x - c", 1, name="up"),
        Transition("high", "low", "x - c", -1, name="down"),
    )
    orbit = follower({"o": {"low": "0", "high": "1 + x"}}, tolerance, 1.0, ("low", "high"), events)
    found = orbit.sensitivity(["mean(o)", "max(o)", "fraction(high)"], ["A", "c"])
    start = math.asin(C / A)
    share, height = 0.5 - start / math.pi, A * math.cos(start) / math.pi
    by_c = -1.0 / (math.pi * math.sqrt(A * A - C * C))
    errors = max(1e-9, 100.0 * tolerance)
    assert found["mean(o)"].attrs["value"] == pytest.approx(share + height, abs=errors)
    assert found["mean(o)"].sel(parameter="c").item() == pytest.approx(by_c * (1.0 + C), abs=errors)
    assert found["max(o)"].attrs["value"] == pytest.approx(1.0 + A, abs=errors)
    assert found["max(o)"].sel(parameter="A").item() == pytest.approx(1.0, abs=errors)
    assert found["fraction(high)"].sel(parameter="c").item() == pytest.approx(by_c, abs=errors)


@pytest.mark.parametrize("tolerance", [1e-12, 1e-9, 1e-7, 1e-5])
def test_a_peak_at_the_end_of_a_segment_moves_with_the_event(tolerance):
    events = (
        Transition("low", "high", "x - c", 1, name="up"),
        Transition("high", "low", "x - c", -1, name="down"),
    )
    outputs = {"o": {"low": "exp(40*(x - 1))*(2 + cos(s))", "high": "0"}}
    orbit = follower(outputs, tolerance, 1.0, ("low", "high"), events)
    found = orbit.sensitivity(["max(o)"], ["A", "c"])["max(o)"]
    top, start = math.exp(40.0 * (C - 1.0)), math.asin(C / A)
    root = math.sqrt(A * A - C * C)
    by_a, by_c = C / A / root, -1.0 / root  # of -start
    slopes = [math.sin(start) * top * by_a, 40.0 * top * (2.0 + math.cos(start)) + math.sin(start) * top * by_c]
    errors = max(1e-9, 1e4 * tolerance)
    assert found.attrs["value"] == pytest.approx(top * (2.0 + math.cos(start)), rel=errors)
    np.testing.assert_allclose(found, slopes, atol=errors * 40.0 * top)


def test_a_jump_within_a_segment_has_a_value_and_no_derivative():
    orbit = follower({"o": "sign(x - c)"}, 1e-12, 1.0)
    found = orbit.sensitivity(["mean(o)", "amplitude(o, 1)"], NAMES)
    start = math.asin(C / A)
    assert found["mean(o)"].attrs["value"] == pytest.approx(-2.0 * start / math.pi, abs=1e-10)
    assert found["amplitude(o, 1)"].attrs["value"] == pytest.approx(4.0 * math.cos(start) / math.pi, abs=1e-10)
    for name in found:
        assert np.isnan(found[name]).all()
        assert "jumps within a segment" in found[name].attrs["note"]
