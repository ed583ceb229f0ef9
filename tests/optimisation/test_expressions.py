"""Objective and constraints of a linear oscillator's orbit against closed forms; phases from orbit to orbit."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from saltus import InputError, find_orbit
from saltus.optimisation.carrying import carrying
from saltus.optimisation.expressions import Expressions, is_parameter, read_expression

LINEAR = {"b": 0.0, "A": 1.0, "c": 0.4, "w": 0.6}
A1, PHASE = "amplitude(x, 1)", "phase(x, 1)"
NAMES = ("w", "c", "A")


@pytest.fixture(scope="module")
def start(duffing):
    return carrying(find_orbit(duffing, LINEAR, [0.0, 0.0]), NAMES)


def response(w=0.6, c=0.4, A=1.0):
    return 1j * A / (1.0 - w**2 + 1j * c * w)


def slopes(function, step=1e-6):
    values = {name: LINEAR[name] for name in NAMES}
    return [
        (function(**(values | {name: values[name] + step})) - function(**(values | {name: values[name] - step})))
        / (2.0 * step)
        for name in NAMES
    ]


FORMS = {
    A1: lambda w, c, A: abs(response(w, c, A)),
    PHASE: lambda w, c, A: np.angle(response(w, c, A)),
    "amplitude(v, 1)/A": lambda w, c, A: w * abs(response(w, c, A)) / A,
    f"c*{A1}**2 + period": lambda w, c, A: c * abs(response(w, c, A)) ** 2 + 2.0 * np.pi / w,
    f"cos({PHASE})": lambda w, c, A: np.cos(np.angle(response(w, c, A))),
    "max(x) - min(x)": lambda w, c, A: 2.0 * abs(response(w, c, A)),
    "period": lambda w, c, A: 2.0 * np.pi / w,
    "c": lambda w, c, A: c,
}


@pytest.mark.parametrize("name", FORMS)
def test_values_and_derivatives_are_those_of_the_closed_form(duffing, start, name):
    found = Expressions(duffing, (name,), False).at(start)
    assert found.values[0] == pytest.approx(FORMS[name](0.6, 0.4, 1.0), rel=1e-8)
    assert found.slopes[0] == pytest.approx(slopes(FORMS[name]), rel=1e-6, abs=1e-8)
    assert found.multipliers.shape == (0,)
    assert found.multiplier_slopes.shape == (0, 3)


def test_several_expressions_keep_their_order_also_with_parameters_among_them(duffing, start):
    names = ("w", A1, "k", "period", "A")
    found = Expressions(duffing, names, False).at(start)
    assert found.values == pytest.approx([0.6, abs(response()), 1.0, 2.0 * np.pi / 0.6, 1.0], rel=1e-8)
    assert found.slopes[0].tolist() == [1.0, 0.0, 0.0]
    assert found.slopes[2].tolist() == [0.0, 0.0, 0.0]  # it does not vary
    assert found.slopes[4].tolist() == [0.0, 0.0, 1.0]


def test_multipliers_of_a_driven_oscillator_are_all_there_and_have_their_derivatives(duffing, start):
    found = Expressions(duffing, (A1,), True).at(start)

    def closed(w, c, A):
        rates = np.roots([1.0, c, 1.0])
        return np.exp(rates[np.argsort(rates.imag)] * 2.0 * np.pi / w)

    order = np.argsort(found.multipliers.imag)
    wanted = closed(0.6, 0.4, 1.0)
    turn = np.argsort(wanted.imag)  # the multiplier may have turned past the real axis
    assert found.multipliers[order] == pytest.approx(wanted[turn], rel=1e-8)
    by = np.array(slopes(closed)).T[turn]
    assert found.multiplier_slopes[order] == pytest.approx(by, rel=1e-6, abs=1e-8)


def test_an_unstable_orbit_is_none_where_stability_is_asked_for(duffing, start):
    unstable = SimpleNamespace(orbit=SimpleNamespace(stable=False))
    assert Expressions(duffing, (A1,), True).at(unstable) == "the orbit loses its stability"


# phases


@pytest.mark.parametrize("rounds", [-2, 0, 1, 7])
def test_a_phase_goes_on_from_that_of_the_orbit_nearby(duffing, start, rounds):
    expressions = Expressions(duffing, (A1, PHASE, "phase(v, 1)"), False)
    alone = expressions.at(start)
    moved = np.array([0.3, 2.0 * np.pi * rounds + 0.5, -0.5])
    found = expressions.at(start, replace(alone, values=alone.values + moved))
    assert found.values - alone.values == pytest.approx([0.0, 2.0 * np.pi * rounds, 0.0], abs=1e-12)
    assert found.slopes.tolist() == alone.slopes.tolist()


def test_a_phase_within_a_formula_may_move_but_not_jump(duffing, start):
    name = f"degrees({PHASE}) + degrees(phase(v, 1))"
    expressions = Expressions(duffing, (name,), False)
    alone = expressions.at(start)
    assert alone.phases.shape == (2,)
    near = replace(alone, phases=alone.phases + np.array([0.4, -0.4]))
    assert expressions.at(start, near).values.tolist() == alone.values.tolist()
    across = replace(alone, phases=alone.phases + np.array([0.0, 2.0 * np.pi]))
    assert expressions.at(start, across) == "phase(v, 1) within a formula jumps by a turn"


# names


@pytest.mark.parametrize("name", ["c", "w", A1, "period", "max_v", f"2*{A1} - c"])
def test_what_can_be_an_expression_is_returned_as_it_is(duffing, name):
    assert read_expression(duffing, name) == name
    assert is_parameter(duffing, name) == (name in {"c", "w"})


BAD = {
    "x": "observable = 'x': must be one number of an orbit; as 'mean(x)' or 'max(x)'",
    "s": "observable = 's': must be one number of an orbit",
    "q": "= 'q': must be a parameter, or ",
    "maxx(x)": "must be a parameter, or",
    "max(q)": "'q'",
    3: "3",
    None: "None",
}


@pytest.mark.parametrize("name", BAD, ids=str)
def test_what_can_be_none_is_told(duffing, name):
    with pytest.raises(InputError) as caught:
        read_expression(duffing, name)
    assert BAD[name] in str(caught.value)
