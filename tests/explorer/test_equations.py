"""Systems as text: what a system prints is read back, and errors name the line."""

import pytest

import saltus
from saltus.errors import DefinitionError
from saltus.explorer.equations import LONGEST, equations_of, read_equations
from systems import ball_on_table

RELAY = """
# a relay that switches late
parameters a = 0.5, c = 0.4
mode plus
  x' = v
  v' = a - c*v - x
mode minus, where 2 - Max(a, c) > 0
  x' = v
  v' = -a - c*v - x
transition plus -> minus when x - 0.2*v rises through 0
transition on: minus -> plus when x - 0.2*v falls through 0 and 1 - x > 0, v := v*(1 - a), x := x
output power = a*v in plus; -a*v in minus
positive a, c
bounds a from 0 to 2
"""


def test_a_text_says_all_of_a_system():
    read = read_equations(RELAY)
    exact = saltus.HybridSystem(
        ("x", "v"), {"a": 0.5, "c": 0.4},
        {
            "plus": saltus.Mode({"x": "v", "v": "a - c*v - x"}),
            "minus": saltus.Mode({"x": "v", "v": "-a - c*v - x"}, domain="2 - Max(a, c)"),
        },
        [
            saltus.Transition("plus", "minus", "x - 0.2*v", 1),
            saltus.Transition("minus", "plus", "x - 0.2*v", -1, {"v": "v*(1 - a)", "x": "x"}, when="1 - x", name="on"),
        ],
        outputs={"power": {"plus": "a*v", "minus": "-a*v"}}, positive=("a", "c"), parameter_bounds={"a": (0.0, 2.0)},
    )  # fmt: skip
    assert read == exact


@pytest.mark.parametrize("name", ["ball", "tent", "smooth map"])
def test_what_a_system_prints_is_read_back(name):
    pieces = {
        "left": saltus.Piece({"x": "a*x"}, where="1/2 - x"), "right": saltus.Piece({"x": "a*(1 - x)"}, where="x - 1/2"),
    }  # fmt: skip
    system = {
        "ball": ball_on_table(),
        "tent": saltus.Map(("x",), {"a": 1.8}, pieces=pieces, name="tent map"),
        "smooth map": saltus.Map(("x", "y"), {"a": 1.4, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"}),
    }[name]
    assert read_equations(equations_of(system)) == system


@pytest.mark.campaign
def test_the_models_are_read_back():
    from saltus.afm.explorer_models import TAPPING

    for key in TAPPING.titles:
        system = TAPPING.subject(key).system
        read, own = read_equations(equations_of(system)).definition(), system.definition()
        assert {key for key in own if read.get(key) != own[key]} <= {"groups", "regimes", "made_of"}, key


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x' = v\nv' = -sin(y)", "line 2, v' = '-sin\\(y\\)': .*'y' is unknown"),
        ("x' = v\n\n# two\nv' = -si(x", "line 4, v' = '-si\\(x'"),
        ("moed a", "line 1, statement = 'moed a': .*did you mean 'mode'"),
        ("x' = a\nparameters a = b", "line 2, a = 'b': must be a number"),
        ("parameters a", "line 1, parameters = 'a'"),
        ("mode a\nx' = 1\ntransition a -> b when x falls", "line 3, transition = "),
        (
            "mode a\nx' = 1\ntransition a -> b when x falls through 0",
            "line 3, transition 'a_to_b' = 'b': .* a mode",
        ),
        ("x' = 1\ntransition smooth -> smooth when x falls through 0, x = 1", "line 2, "),
        ("mode a, if x > 0\nx' = 1", "line 1, mode 'a'"),
        ("piece a, where x\nx -> 1", "line 1, piece 'a'"),
        ("x' = 1\nmode", "line 2, mode = ''"),
        ("output z", "line 1, output"),
        ("x' = x\ny -> y", "of a flow, or of a map"),
        ("# nothing", "with equations"),
        ("x' = x\nx' = -x", "line 2, x' = '-x': must be written once"),
        ("x -> x/2\nx -> -x", "line 2, x -> = '-x': must be written once"),
        ("parameters a = 1, a = 2\nx' = -a*x", "line 1, parameters = 'a = 2': must be written once"),
        ("parameters a = 1\nx' = -a*x\nbounds a from 0 to 1\nbounds a from 0 to 2", "line 4, bounds = .* written once"),
        ("phase s' = 1\nx' = -x\nphase s' = 2", "line 3, phase = .* written once"),
        ("mode a, where x > 0\nx' = 1\nmode a, where 2 - x > 0", "line 3, mode 'a' = .* written once"),
        ("mode a\nx' = 1\ntransition a -> a when x falls through 0, x := 1, x := 2", "x := 2': must be written once"),
        ("x' = -x\noutput z = x\noutput z = 2*x", "line 3, output 'z' = '2\\*x': must be written once"),
        ("mode a\nx' = -x\noutput z = x in a; 2*x in a", "line 3, output 'z' = .* written once"),
        ("x' = __import__('os')", "line 1, x'"),
        (" " * (LONGEST + 1), f"at most {LONGEST} characters"),
    ],
)
def test_an_error_names_its_line(text, told):
    with pytest.raises(DefinitionError, match=told):
        read_equations(text)
