"""Fields in w = sqrt|h|: which modes are written so, and that the series in sigma solve the equations."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest
import sympy
from numpy.polynomial import polynomial

import systems
from saltus import afm
from saltus.system.derivatives import Symbolic
from saltus.system.grammar import FUNCTIONS
from saltus.system.hybrid import HybridSystem, Mode, Transition
from saltus.system.writing.regularise import multiple_of, regularised

ORDER = 12


def spring(force, event="x - d", *, positive=(), direction=1, **parameters):
    """A mass that meets a spring of some force law where the event function crosses zero."""
    return HybridSystem(
        ("x", "v"),
        {"d": 1.0, "k": 2.0, **parameters},
        {"free": Mode({"x": "v", "v": "-x"}), "contact": Mode({"x": "v", "v": f"-x - {force}"})},
        [Transition("free", "contact", event, direction), Transition("contact", "free", event, -direction)],
        positive=positive,
    )


def found(system, mode=1):
    return regularised(Symbolic(system), mode)


def field_in_w(system, mode=1):
    return {str(s): str(f) for s, f in zip(system.states, found(system, mode).field, strict=False)}


@pytest.mark.parametrize(
    ("force", "written"),
    [
        ("(x - d)**(3/2)", "w**3"),
        ("(x - d)**1.5", "w**3"),
        ("sqrt(x - d)", "w"),
        ("k*(x - d)**(5/2)", "k*w**5"),
        ("(x - d)**2*sqrt(x - d)*v", "v*w**5"),
        ("((x - d)/4)**(3/2)", "w**3/8"),
        ("(9*x - 9*d)**(3/2)", "27*w**3"),
        ("(2*(x - d)*k)**(3/2)", "2*sqrt(2)*k**(3/2)*w**3"),
    ],
)
def test_powers_of_the_event_function_become_powers_of_w(force, written):
    system = spring(force, positive=("k",))
    w = found(system).w
    names = {name: sympy.Symbol(name, real=True) for name in ("x", "v", "d", "k")} | {"w": w}
    expected = -names["x"] - sympy.sympify(written, locals=names)
    assert (found(system).transition, found(system).sign) == (1, 1)
    numbers = {names["x"]: 1.3, names["v"]: 0.4, names["d"]: 0.8, names["k"]: 1.7, w: 0.9}
    assert not found(system).field[1].has(sympy.sqrt(names["x"] - names["d"]))
    assert float(found(system).field[1].subs(numbers)) == pytest.approx(float(expected.subs(numbers)), rel=1e-14)


def test_the_sign_is_that_of_the_event_function_in_the_mode():
    below = spring("(d - x)**(3/2)", direction=-1)
    assert (found(below).transition, found(below).sign) == (1, -1)
    assert field_in_w(below)["v"] == "-w**3 - x"


def test_a_factor_of_unknown_sign_keeps_its_root():
    assert found(spring("(k*(x - d))**(3/2)")) is None
    assert found(spring("(k*(x - d))**(3/2)", positive=("k",))).sign == 1
    assert found(spring("(-k*(x - d))**(3/2)", positive=("k",))).sign == -1


@pytest.mark.parametrize(
    ("force", "event"),
    [
        ("(x - 2*d)**(3/2)", "x - d"),
        ("(v + 3)**(3/2)", "x - d"),
        ("(x - d)**2", "x - d"),
        ("(x - d)**(4/3)", "x - d"),
        ("sqrt(k)*(x - d)", "x - d"),
        ("sqrt(x**2 + v**2)", "x - d"),
    ],
)
def test_other_powers_stay_what_they_are(force, event):
    assert found(spring(force, event, positive=("k",))) is None


def test_a_root_of_the_event_of_another_mode_stays_a_root():
    system = HybridSystem(
        ("x", "v"),
        {},
        {"free": Mode({"x": "v", "v": "-sqrt(x - 1)"}), "contact": Mode({"x": "v", "v": "-x"})},
        [Transition("contact", "free", "x - 1", 1), Transition("free", "contact", "v", 1)],
    )
    assert found(system, 0) is None
    assert found(system, 1) is None


def test_a_state_named_w_does_not_get_in_the_way():
    system = HybridSystem(
        ("x", "w"),
        {},
        {"m": Mode({"x": "w", "w": "-x - (x - 1)**(3/2)"})},
        [Transition("m", "m", "x - 1", -1, {"w": "-w"})],
    )
    inside = found(system, 0)
    assert inside.w not in Symbolic(system).x
    assert inside.field[0] == sympy.Symbol("w", real=True)
    assert inside.field[1].has(inside.w)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_contact_of_the_cantilever_is_in_w_and_its_flight_is_not(n):
    system = afm.tapping_mode(afm.table1(), modes=n)
    assert found(system, 0) is None
    contact = found(system, 1)
    assert (contact.transition, contact.sign) == (system.transition_names.index("release"), -1)
    gap = Symbolic(system).event[1]
    for rate in contact.field[n : 2 * n]:
        assert not any(power.exp.is_Rational and power.exp.q == 2 and power.has(*gap.free_symbols & set(
            Symbolic(system).x)) for power in rate.atoms(sympy.Pow))  # fmt: skip
        assert sympy.Poly(rate, contact.w).degree() == 3
    assert system.series(ORDER).forms.tolist() == [[-1, 1], [1, -1]]


def series_in_sigma(system, x, w):
    """Coefficients (order + 1, column) in contact from a state and w: states, w, time, event."""
    series = system.series(ORDER)
    numbers = ctypes.POINTER(ctypes.c_double)
    function = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, numbers, numbers, numbers)
    p, out = series.constants(system.parameter_vector({})), np.zeros((series.order + 1, series.stride))
    start = np.append(system.full_state(x), w)
    function(int(series.addresses[1]))(len(system.modes) + 1, 0, *(a.ctypes.data_as(numbers) for a in (start, p, out)))
    return out.T


def product(*factors):
    result = np.array([1.0])
    for factor in factors:
        result = polynomial.polymul(result, factor)[:ORDER]
    return np.append(result, np.zeros(ORDER - result.size))


def sine(theta, angle):
    """Coefficients of sin(theta + angle), angle a polynomial without a constant."""
    total, power = np.zeros(ORDER), np.array([1.0])
    for k in range(ORDER):
        total[: power.size] += math.sin(theta + 0.5 * math.pi * k) / math.factorial(k) * power[:ORDER]
        power = product(power, angle)
    return total


@pytest.mark.parametrize(("w", "theta"), [(0.0, 0.3), (0.04, 2.9), (0.11, 0.0), (-0.02, 4.0)])
def test_series_in_sigma_solve_the_equations_of_contact(w, theta):
    system = systems.afm(1)
    ybar, b, k = 0.108, systems.B[0], systems.K[0]
    q = 1.0 - systems.A0 - ybar * math.sin(theta) + w * w  # on the surface that w says
    columns = series_in_sigma(system, [q, 0.35, theta], w)
    position, speed, root, time, event = columns[:5]
    one = np.eye(1, ORDER)[0]
    drive = sine(theta, time)
    push = systems.C / systems.A0**2 * one + systems.G * product(root, root, root)
    rate = -4.0 * speed[:-1] - k * position[:-1] + systems.C * one - push + b * ybar * drive
    slopes = {name: column[1:] * np.arange(1, ORDER + 1) for name, column in zip("qvwt", columns, strict=False)}
    scale = np.abs(columns[:4, 1:]).max(axis=0) * np.arange(1, ORDER + 1)
    assert slopes["t"] == pytest.approx(root[:-1], rel=1e-14)
    assert np.abs(slopes["q"] - product(root, speed)).max() <= 1e-12 * scale.max()
    assert np.all(np.abs(slopes["v"] - product(root, rate)) <= 1e-12 * scale)
    # w stays the root of the depth, and is what the event function is followed by
    depth = systems.A0 * one - (one - position[:-1] - ybar * drive)
    assert product(root, root) == pytest.approx(depth, abs=1e-13 * np.abs(depth).max())
    assert event == pytest.approx(-root, abs=0.0)


@pytest.mark.parametrize(
    ("event", "state", "written"),
    [
        ("x - d", 0, "d + w**2"),
        ("2*x + 3*v - d - sin(s)/2", 1, "(w**2 - 2*x + d + sin(s)/2)/3"),
        ("x - d + v/1000", 0, "d - v/1000 + w**2"),
        ("v**2 + x - cos(2*s)", 0, "w**2 - v**2 + cos(2*s)"),
        ("d*x - 1", None, None),
        ("x - tan(s/2)", None, None),
    ],
)
def test_w_tells_a_state_that_its_event_function_is_linear_in(event, state, written):
    system = HybridSystem(
        ("x", "v"),
        {"d": 1.0, "w0": 1.0},
        {"free": Mode({"x": "v", "v": "-x"}), "contact": Mode({"x": "v", "v": f"-x - ({event})**(3/2)"})},
        [Transition("free", "contact", event, 1), Transition("contact", "free", event, -1)],
        phase=("s", "w0"),
    )
    symbolic = Symbolic(system)
    solved = regularised(symbolic, 1).solved(symbolic)
    if state is None:
        assert solved is None
        return
    names = {name: sympy.Symbol(name, real=True) for name in ("x", "v", "s", "d", "w")}
    assert solved[0] == state
    assert sympy.expand(solved[1] - sympy.sympify(written, locals=names)) == 0


def test_nested_roots_off_the_surface_are_told_by_numbers_without_algebra(monkeypatch):
    simple = sympy.cancel

    def cancel(ratio):
        return pytest.fail("nested roots are simplified") if ratio.atoms(sympy.Pow) else simple(ratio)

    monkeypatch.setattr(sympy, "cancel", cancel)
    symbolic = Symbolic(spring("(1 + sqrt(x - d)*sqrt(x**2 + 3*x + 9))**(1/3)", d=0.5))
    bases = {power.base for power in symbolic.field[1][1].atoms(sympy.Pow)}
    found = {base: multiple_of(symbolic, base, symbolic.event[0]) for base in bases}
    assert len(found) == 4
    assert {base: ratio for base, ratio in found.items() if ratio is not None} == {symbolic.event[0]: (1, 1)}


@pytest.mark.parametrize("name", sorted(set(FUNCTIONS) - {"Max", "Min", "degrees", "radians"}))
def test_roots_of_every_function_can_be_compared_with_the_surface(name):
    argument = "sqrt(x - 3), v" if name == "atan2" else "sqrt(x - 3)"  # no real number at some states
    symbolic = Symbolic(spring(f"sqrt(2 + {name}({argument}))"))
    bases = {power.base for power in symbolic.field[1][1].atoms(sympy.Pow)}
    assert len(bases) == 2
    assert all(multiple_of(symbolic, base, symbolic.event[0]) is None for base in bases)
