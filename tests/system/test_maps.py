"""A map is checked when it is made; image and derivatives are compiled as those of a flow are."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from discrete import HENON, LOGISTIC, TENT
from saltus import HybridSystem, InputError, Map, Mode, Piece
from saltus.errors import DefinitionError
from saltus.system.plain import check_plain, system_from


def pieces(**where):
    return {name: Piece({"x": "x"}, where=condition) for name, condition in where.items()}


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({}, "image, pieces = 'none': must be exactly one of the two given"),
        ({"image": {"x": "x"}, "pieces": pieces(a=None)}, "image, pieces = 'both'"),
        ({"image": {"y": "x"}}, "piece 'map' = .*an equation for each of x; 'x' is missing"),
        ({"image": {"x": "x", "y": "x"}}, "piece 'map' = 'y': must be a state: x"),
        ({"image": {"x": "q*x"}}, "piece 'map' = 'q.x': .*'q' is unknown"),
        ({"image": 3}, "image = 3: must be a mapping of each state to its next value"),
        ({"pieces": {}}, "pieces = .*at least one piece"),
        ({"pieces": {"a": {"x": "x"}}}, "piece 'a' = .*a Piece"),
        ({"pieces": {"a": Piece("x")}}, "piece 'a' = 'x': must be a mapping of each state to its next value"),
        ({"pieces": pieces(a="q - x", b="x - q")}, "piece 'a' = 'q - x'.*'q' is unknown"),
        ({"image": {"x": "x"}, "outputs": {"o": {"left": "x"}}}, "output 'o' = .*each of the pieces map"),
        ({"image": {"x": "x"}, "groups": {"g": ["z"]}}, "group 'g' = 'z'"),
        ({"image": {"x": "x"}, "positive": ["z"]}, "positive, parameter_bounds = 'z'"),
    ],
)
def test_wrong_parts_are_told(parts, message):
    with pytest.raises(DefinitionError, match=message):
        Map(("x",), {"a": 1.0}, **parts)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ({"low": "-x", "high": "x - a"}, r"x = 0.5'.*none of 'low', 'high' does"),
        ({"low": "a - x", "high": "x"}, r"x = 0.5'.*'low', 'high' do at once"),
        ({"low": "-x", "high": ("x", "a - x")}, r"x = 2'.*none of 'high' does"),
        ({"low": ("-x", "x + a"), "high": "x"}, r"x = -2'.*none of 'low' does"),
        ({"low": "-x"}, "none of 'low' does"),
        ({"low": None, "high": "x"}, "'high', 'low' do at once|'low', 'high' do at once"),
        ({"low": "-a", "high": "-2*a"}, "none of 'low', 'high' does"),
        ({"near": "a - x**2", "far": "x**2 - 2"}, "none of 'near', 'far' does"),
        ({"near": "2 - x**2", "far": "x**2 - a"}, "'near', 'far' do at once"),
        ({"low": "1e-9 - x**3/x**2", "high": "x - 3e-9 - 0*x**2"}, "none of"),
    ],
)
def test_gaps_and_overlaps_are_refused(where, message):
    with pytest.raises(DefinitionError, match=message):
        Map(("x",), {"a": 1.0}, pieces=pieces(**where))


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0, 1e6])
def test_a_curved_gap_is_found_at_every_size(size):
    disc = "(x**2 + y**2)"
    image = {"x": "x", "y": "y"}
    parts = {"near": Piece(image, f"d**2 - {disc}"), "far": Piece(image, f"{disc} - 4*d**2")}
    with pytest.raises(DefinitionError, match="none of 'near', 'far' does"):
        Map(("x", "y"), {"d": size}, pieces=parts)
    whole = {"near": Piece(image, f"d**2 - {disc}"), "far": Piece(image, f"{disc} - d**2")}
    assert Map(("x", "y"), {"d": size}, pieces=whole).piece_of([1.1 * size, 0.0]) == "far"


@pytest.mark.parametrize(
    "where",
    [
        {"low": "0.9 - 3*x", "high": "x - 0.3"},
        {"left": "-x - a", "middle": ("x + a", "a - x"), "right": "x - a"},
        {"whole": "a"},
        {"near": "a - x**2", "far": "x**2 - a"},
        {"in": "cos(x)", "out": "-cos(x)"},
    ],
)
def test_pieces_that_tile_are_taken(where):
    assert Map(("x",), {"a": 1.0}, pieces=pieces(**where)).piece_names == tuple(where)


def test_quadrants_tile_the_plane_and_three_of_them_do_not():
    image = {"x": "x", "y": "y"}
    signs = {"ne": ("x", "y"), "nw": ("-x", "y"), "sw": ("-x", "-y"), "se": ("x", "-y")}
    whole = Map(("x", "y"), {}, pieces={name: Piece(image, where) for name, where in signs.items()})
    assert [whole.piece_of(x) for x in ([1, 1], [-1, 1], [-1, -1], [1, -1], [0, 0])] == [*signs, "ne"]
    signs.pop("sw")
    with pytest.raises(DefinitionError, match="none of 'ne', 'nw', 'se' does"):
        Map(("x", "y"), {}, pieces={name: Piece(image, where) for name, where in signs.items()})


def test_derivatives_are_those_of_the_image():
    x, step = np.array([0.3, -0.2]), 1e-6
    jacobian = HENON.jacobian(x)
    for j, push in enumerate(step * np.eye(2)):
        slope = (HENON.image(x + push) - HENON.image(x - push)) / (2 * step)
        np.testing.assert_allclose(jacobian[:, j], slope, atol=1e-9)
    assert jacobian.tolist() == [[-0.84, 1.0], [0.3, 0.0]]
    out, p = np.empty(2), HENON.compiled.extended(HENON.parameter_vector({}))
    HENON.compiled.call("field_p", 0, 0, x, p, out)
    assert out.tolist() == pytest.approx([-0.09, 0.0])


def test_second_derivatives_are_compiled_as_those_of_a_flow():
    flow = HybridSystem(HENON.states, HENON.parameters, {"map": Mode({"x": "1 - a*x**2 + y", "y": "b*x"})})
    for active in ((), (0,), (0, 1)):
        assert HENON.second(active).active == flow.second(active).active == active
        assert HENON.second(active).extended == flow.second(active).extended
    assert HENON.second((0,)) is HENON.second((0,))


def test_each_piece_has_its_own_derivative():
    assert TENT.jacobian([0.2]).tolist() == [[1.8]]
    assert TENT.jacobian([0.8]).tolist() == [[-1.8]]
    assert TENT.image([0.8], parameters={"a": 1.0}).tolist() == pytest.approx([0.2])


def test_plain_data_make_an_equal_map():
    for system in (HENON, TENT):
        assert Map.from_definition(system.definition()) == system
        assert system_from(system.definition()) == system
        assert pickle.loads(pickle.dumps(system)) == system
        assert hash(pickle.loads(pickle.dumps(system))) == hash(system)
    assert HENON != TENT
    flow = HybridSystem(("x",), {"r": 3.2}, {"map": Mode({"x": "r*x*(1 - x)"})}, name="logistic map")
    assert flow != LOGISTIC
    assert flow != LOGISTIC


def test_damaged_plain_data_are_told():
    data = TENT.definition()
    with pytest.raises(DefinitionError, match="'phase': must be one of name, states"):
        check_plain(data | {"phase": None})
    with pytest.raises(DefinitionError, match="a mapping with 'image'"):
        check_plain(data | {"pieces": {"left": {"where": []}}})
    with pytest.raises(DefinitionError, match="as Map.definition returns it"):
        Map.from_definition({"states": ["x"]})


def test_the_text_of_a_map_shows_its_pieces():
    assert str(TENT).splitlines()[3:] == [
        "  piece left, where 1/2 - x > 0", "    x -> a*x", "  piece right, where x - 1/2 > 0", "    x -> a*(1 - x)",
        "  output double = 2*x",
    ]  # fmt: skip
    assert r"x &amp;\mapsto a x" in TENT._repr_html_()
    assert "where $\\frac{1}{2} - x &gt; 0$" in TENT._repr_html_()
    assert repr(Piece({"x": "-x"}, where=("x", "1 - x"))) == "Piece(x -> -x; where x > 0 and 1 - x > 0)"


def test_bounds_and_groups_hold_as_in_hybrid_systems():
    bounded = Map(("x",), {"a": 1.0, "b": 1.0}, {"x": "a*b*x"}, groups={"both": ["a", "b"]}, positive=["a"])
    assert bounded.image([1.0], parameters={"both": 3.0}).tolist() == [9.0]
    with pytest.raises(InputError, match="a = -1.0: must be > 0"):
        bounded.image([1.0], parameters={"a": -1.0})
    assert bounded.allowed("a")[0] > 0.0
