"""Iterates of maps: closed forms, itineraries, borders, motions that end early, files and pictures."""

from __future__ import annotations

import math
import pickle
from itertools import pairwise

import numpy as np
import pytest

import saltus
from discrete import HENON, LOGISTIC, TENT, tent_of
from saltus import InputError, Map, Piece, iterate
from saltus.errors import DefinitionError, DivergenceError, MapDivergenceError


def test_logistic_map_at_four_is_the_square_of_a_sine():
    angle = 0.1
    found = iterate(LOGISTIC, {"r": 4.0}, [math.sin(angle) ** 2], n=20)
    exact = np.sin(angle * 2.0 ** np.arange(21)) ** 2
    # an error doubles with each iteration
    np.testing.assert_allclose(found.states[:, 0], exact, atol=2.0**20 * 1e-15)


def test_henon_map_agrees_with_a_plain_loop_to_the_last_bit_but_rounding():
    x, y, seen = 0.1, 0.1, [(0.1, 0.1)]
    for _ in range(10):
        x, y = 1.0 - 1.4 * x * x + y, 0.3 * x
        seen.append((x, y))
    np.testing.assert_allclose(iterate(HENON, x0=[0.1, 0.1], n=10).states, seen, rtol=1e-12)


def test_discarded_iterations_are_made():
    whole, rest = iterate(HENON, x0=[0.1, 0.1], n=30), iterate(HENON, x0=[0.1, 0.1], n=10, discard=20)
    assert np.array_equal(whole.states[20:], rest.states)
    assert np.array_equal(rest.steps, np.arange(20, 31))
    assert len(rest) == 11


def test_itinerary_of_the_tent_map_is_the_binary_expansion():
    # with slope 2 the itinerary of x has the digits of x in Gray code
    x = 0.637
    digits, bits = iterate(TENT, {"a": 2.0}, [x], n=30).itinerary, []
    y = x
    for _ in range(31):
        bits.append(int(2.0 * y))
        y = 2.0 * y - int(2.0 * y)
    gray = [bits[0], *(a ^ b for a, b in pairwise(bits))]
    assert [("left", "right")[bit] for bit in gray] == list(digits)


def test_parameters_differ_from_the_defaults_where_given():
    assert iterate(LOGISTIC, {"r": 2.0}, [0.5], n=1).states[1, 0] == 0.5
    assert iterate(LOGISTIC, {"r": 2.0}, [0.5], n=1).parameters["r"] == 2.0


def test_on_a_border_the_first_piece_holds():
    steps = Map(("x",), {}, pieces={"low": Piece({"x": "x - 1"}, "-x"), "high": Piece({"x": "x + 1"}, where="x")})
    turned = Map(("x",), {}, pieces={"high": Piece({"x": "x + 1"}, "x"), "low": Piece({"x": "x - 1"}, where="-x")})
    assert iterate(steps, x0=[0.0], n=1).states[1, 0] == -1.0
    assert iterate(turned, x0=[0.0], n=1).states[1, 0] == 1.0


def test_borders_written_in_two_ways_leave_no_gap_of_rounding():
    # 0.9 - 3 x and x - 0.3 do not vanish at the same number
    thirds = Map(("x",), {}, pieces={"low": Piece({"x": "x"}, "0.9 - 3*x"), "high": Piece({"x": "x"}, "x - 0.3")})
    for x in 0.3 + np.arange(-8, 9) * np.spacing(0.3):
        assert iterate(thirds, x0=[x], n=3).states[-1, 0] == x


def test_a_gap_that_a_parameter_opens_is_told_with_state_and_pieces():
    opened = Map(("x",), {"d": 0.0}, pieces={"low": Piece({"x": "x + 0.3"}, "-x"), "high": Piece({"x": "x"}, "x - d")})
    with pytest.raises(DefinitionError, match=r"state = 'x = 0.2': .*none of 'low', 'high' does"):
        iterate(opened, {"d": 0.5}, [-0.4])
    with pytest.raises(DefinitionError, match=r"state = 'x = -0.1': .*'low', 'high' do at once"):
        iterate(opened, {"d": -0.5}, [-0.1])
    with pytest.raises(DefinitionError, match="none of 'low', 'high' does"):
        opened.piece_of([0.2], parameters={"d": 0.5})


def test_a_piece_holds_nowhere_that_a_condition_is_no_number():
    where = {"low": ("log(x)", "1 - x**2 + x**2"), "high": ("-log(x)", "1 + 0*x")}
    undefined = Map(("x",), {}, pieces={name: Piece({"x": "x - 2"}, texts) for name, texts in where.items()})
    assert undefined.piece_of([1.5]) == "low"
    for attempt in (lambda: iterate(undefined, x0=[1.5]), lambda: undefined.piece_of([-0.5])):
        with pytest.raises(DefinitionError, match=r"x = -0.5'.*none of 'low', 'high' does"):
            attempt()


def test_a_diverging_motion_tells_step_and_state():
    with pytest.raises(MapDivergenceError, match="the motion diverges at iteration 9, state") as told:
        iterate(LOGISTIC, {"r": 4.0}, [1.1])
    assert told.value.step == 9
    assert told.value.state[0] < -1e100
    assert isinstance(told.value, DivergenceError)
    assert str(pickle.loads(pickle.dumps(told.value))) == str(told.value)


def test_a_state_that_is_no_number_is_told():
    root = Map(("x",), {}, {"x": "log(x)"})
    with pytest.raises(MapDivergenceError, match="a component is no number") as told:
        iterate(root, x0=[0.5])
    assert told.value.step == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"system": 3}, "system = 3: must be a Map"),
        ({"x0": [0.1, 0.2]}, r"x0 = \[0.1, 0.2\]: must be of shape \(1,\)"),
        ({"x0": [math.nan]}, r"x0 = \[nan\]: must be finite"),
        ({"parameters": {"q": 1.0}}, "parameter = 'q'"),
        ({"n": -1}, "n = -1"),
        ({"discard": 1.5}, "discard = 1.5"),
    ],
)
def test_wrong_arguments_are_told(arguments, message):
    with pytest.raises(InputError, match=message):
        iterate(**({"system": LOGISTIC, "x0": [0.1]} | arguments))


def test_a_hybrid_system_is_refused_and_a_map_where_a_flow_is_wanted():
    fall = saltus.HybridSystem(("x",), {}, {"free": saltus.Mode({"x": "-x"})})
    with pytest.raises(InputError, match="simulate follows a HybridSystem"):
        iterate(fall, x0=[1.0])
    with pytest.raises(InputError, match="must be a HybridSystem; this is a map: use iterate"):
        saltus.simulate(LOGISTIC, {}, [0.1])


def test_iterates_are_saved_and_loaded_equal(tmp_path):
    found = iterate(tent_of(), x0=[0.2], n=12, discard=3)
    assert saltus.load(found.save(tmp_path / "tent.nc")) == found
    assert pickle.loads(pickle.dumps(found)) == found
    again = found.to_xarray().assign_attrs(first=4)
    with pytest.raises(InputError, match="counted from 4 on"):
        saltus.results.Iterates.from_xarray(again)


def test_observables_are_those_of_the_states():
    found = iterate(tent_of(), x0=[0.2], n=99)
    seen = found.observe("max(x)", "min(x)", "mean(double)", "fraction(left)")
    x = found.states[:, 0]
    assert seen == pytest.approx(
        {"max(x)": x.max(), "min(x)": x.min(), "mean(double)": 2 * x.mean(), "fraction(left)": np.mean(x <= 0.5)}
    )
    assert np.array_equal(found.output("double + 1"), 2 * x + 1)
    with pytest.raises(InputError, match="a map has no phase and no transitions"):
        found.observe("amplitude(x, 1)")


def test_a_map_in_billionths_moves_as_in_ones():
    small = Map(("x",), {"a": 1.8, "u": 1e-9}, pieces={
        "left": Piece({"x": "a*x"}, "u/2 - x"), "right": Piece({"x": "a*(u - x)"}, "x - u/2"),
    })  # fmt: skip
    one, other = iterate(TENT, {"a": 1.8}, [0.2], n=30), iterate(small, x0=[0.2e-9], n=30)
    # rounding grows by 1.8 with each iteration
    np.testing.assert_allclose(other.states * 1e9, one.states, atol=1.8**30 * 1e-15)
    assert one.itinerary == other.itinerary


def test_the_repr_tells_ends_and_pieces():
    assert repr(iterate(tent_of(), x0=[0.2], n=3)) == (
        "Iterates of tent map: iterations 0 to 3\n  from  x = 0.2\n  to    x = 0.6336\n  pieces left x2, right x2"
    )


@pytest.mark.parametrize("options", [{}, {"x": "x", "y": "double"}, {"cobweb": True}, {"legend": False}])
def test_pictures_show_the_states(options):
    found = iterate(tent_of(), x0=[0.2], n=30)
    ax = found.plot(**options)
    lines = [line.get_xydata() for line in ax.get_lines()]
    if options.get("cobweb"):
        assert any(len(line) == 2 * 31 - 1 for line in lines)
        assert ax.get_ylabel() == "next $x$"
    else:
        assert sum(len(line) for line in lines[-2:]) == 31
    assert (ax.get_legend() is None) == (options.get("legend") is False)


def test_a_cobweb_needs_one_state():
    with pytest.raises(InputError, match="left out for a map of 2 states"):
        iterate(HENON, x0=[0.1, 0.1]).plot(cobweb=True)
