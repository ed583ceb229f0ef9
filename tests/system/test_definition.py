"""A definition is checked when it is made, and every message names the part at fault."""

import math
import pickle

import numpy as np
import pytest
import sympy

import systems
from saltus import HybridSystem, InputError, Mode, Transition
from saltus.errors import DefinitionError
from saltus.system.compiled import FLOW
from saltus.system.evaluate import evaluate
from saltus.system.generated import source_file


def make(**changes):
    parts = {
        "states": ("z", "v"),
        "parameters": {"g": 1.0, "e": 0.5, "a": 1.2, "w": 1.0},
        "modes": {"flight": Mode({"z": "v", "v": "-g"}, domain="z - a*sin(theta) + 1")},
        "transitions": [
            Transition(
                "flight", "flight", event="z - a*sin(theta)", direction=-1,
                reset={"v": "-e*v + (1+e)*a*w*cos(theta)"}, name="impact",
            )
        ],
        "phase": ("theta", "w"),
        "outputs": {"gap": "z - a*sin(theta)"},
    } | changes  # fmt: skip
    return HybridSystem(**parts)


def transition(**changes):
    return [Transition(**({"source": "flight", "target": "flight", "event": "z", "name": "impact"} | changes))]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"modes": {"flight": Mode({"z": "v", "v": "-gg"})}},
            "mode 'flight' = '-gg'.*'gg' is unknown; did you mean 'g'",
        ),
        ({"modes": {"flight": Mode({"z": "v"})}}, "mode 'flight' = .*an equation for each of z, v; 'v' is missing"),
        ({"modes": {"flight": Mode({"z": "v", "v": "-g", "q": "1"})}}, "mode 'flight' = 'q': must be a state: z, v"),
        ({"modes": {"flight": Mode({"z": "v", "v": "-g", "theta": "1"})}}, "the phase has its rate already"),
        ({"modes": {}}, "modes = .*at least one mode"),
        ({"modes": {"flight": {"z": "v"}}}, "mode 'flight' = .*a Mode"),
        ({"modes": {"flight": Mode({"z": "v", "v": "-g"}, domain="zz")}}, "mode 'flight' = 'zz'"),
        ({"transitions": transition(target="fligt")}, "transition 'impact' = 'fligt'.*did you mean 'flight'"),
        ({"transitions": transition(source="up")}, "transition 'impact' = 'up': must be a mode: flight"),
        ({"transitions": transition(reset={"w2": "v"})}, "transition 'impact' = 'w2': must be a state to reset: z, v"),
        ({"transitions": transition(reset={"theta": "0"})}, "transition 'impact' = 'theta'.*other than the phase"),
        (
            {"transitions": transition(event="g - 1")},
            "transition 'impact' = 'g - 1': must be an event function of the state",
        ),
        ({"transitions": transition(event="z +")}, "transition 'impact' = .z \\+.: must be an expression"),
        ({"transitions": transition(direction=2)}, "transition 'impact' = 2: must be -1"),
        ({"transitions": transition(when="vv")}, "transition 'impact' = 'vv'"),
        (
            {"transitions": transition() + transition()},
            "transition 'impact' = 'impact': must be named once; pass name=",
        ),
        ({"transitions": ["impact"]}, "transitions = 'impact': must be a sequence of Transition"),
        ({"states": ("z", "__v")}, "states = '__v': must be a name that does not begin with two underscores"),
        ({"states": ("z", "lambda")}, "states = 'lambda': must be a name that is not a Python keyword"),
        ({"states": ("z", "z")}, "= 'z': must be named once"),
        ({"states": "zv"}, "states = 'zv': must be a sequence of names"),
        ({"parameters": {"g": 1.0, "e": 0.5, "a": 1.2, "w": 1.0, "z": 1.0}}, "= 'z': must be named once"),
        (
            {"parameters": {"g": 1.0, "e": 0.5, "a": 1.2, "w": 1.0, "sin": 2.0}},
            r"'z - a\*sin\(theta\) \+ 1': must be an expression in which 'sin' is not called: the definition declares",
        ),
        ({"phase": ("theta", "w*z")}, "phase = 'w\\*z'.*'z' is unknown"),
        ({"outputs": {"gap": "zz"}}, "output 'gap' = 'zz'"),
        (
            {"outputs": {"gap": {"ground": "z"}}},
            "output 'gap' = \\['ground'\\]: must be given for each of the modes flight",
        ),
        (
            {"outputs": {"gap": "z*theta"}},
            "output 'gap' = 'z\\*theta': must be of period 2 pi in theta; theta is an angle, as in cos",
        ),
        ({"groups": {"all": ("g", "q")}}, "group 'all' = 'q'"),
        ({"positive": ("q",)}, "positive, parameter_bounds = 'q'"),
        ({"positive": 3}, "positive = 3: must be a sequence of names of parameters"),
        ({"positive": "g"}, "positive = 'g': must be a sequence of names of parameters"),
        ({"states": 3}, "states = 3: must be a sequence of names"),
        ({"parameters": {"a": "q"}}, "a = 'q': must be a finite number"),
        ({"parameters": {"a": True}}, "a = True: must be a finite number"),
        ({"parameters": "abc"}, "parameters = 'abc': must be a mapping of names to numbers"),
        ({"phase": "t"}, "phase = 't': must be a name and a rate"),
        ({"phase": ("theta",)}, r"phase = \('theta',\): must be a name and a rate"),
        ({"parameter_bounds": {"a": 3}}, "parameter_bounds of 'a' = 3: must be the two ends of an interval"),
        ({"parameter_bounds": {"a": (2.0, 1.0)}}, "parameter_bounds of 'a' = .*must be an interval with the lower end"),
        ({"parameter_bounds": {"a": ("x", 1.0)}}, "parameter_bounds of 'a' = 'x': must be a number"),
        ({"parameter_bounds": 3}, "parameter_bounds = 3: must be a mapping of parameters to intervals"),
        ({"modes": {"flight": Mode("x")}}, "mode 'flight' = 'x': must be a mapping of each state to its rate"),
        ({"modes": Mode({"z": "v", "v": "-g"})}, "modes = Mode.*must be a mapping of names to Mode"),
        ({"transitions": 3}, "transitions = 3: must be a sequence of Transition"),
        ({"transitions": transition()[0]}, "transitions = Transition.*must be a sequence of Transition"),
        (
            {"transitions": transition(reset="v")},
            "transition 'impact' = 'v': must be a mapping of states to new values",
        ),
        ({"transitions": transition(source=3)}, "transition 'impact' = 3: must be a mode: flight"),
        ({"transitions": transition(direction="down")}, "transition 'impact' = 'down': must be -1"),
        ({"transitions": transition(direction=[1])}, r"transition 'impact' = \[1\]: must be -1"),
        ({"transitions": transition(name=3)}, "transition = 3: must be text as its name"),
        ({"outputs": 3}, "outputs = 3: must be a mapping of names to expressions"),
        ({"outputs": {"gap": [1]}}, r"output 'gap' = \[1\]: must be an expression"),
        ({"groups": ["g"]}, r"groups = \['g'\]: must be a mapping of names to sequences"),
        ({"groups": {"all": 3}}, "group 'all' = 3: must be a sequence of names of parameters"),
        ({"groups": {"all": "ga"}}, "group 'all' = 'ga': must be a sequence of names of parameters"),
        ({"regimes": {"up": ("flght",)}}, "regime 'up' = 'flght': must be a mode: flight; did you mean 'flight'"),
        ({"regimes": {"up": "flight"}}, "regime 'up' = 'flight': must be a sequence of names of modes"),
        ({"let": {"a": "g"}}, "let = 'a': must be a name that no state, phase or parameter has"),
        ({"let": {"gap": "g"}}, "= 'gap': must be named once"),
        ({"let": {"h": "z - q"}}, "let 'h' = 'z - q'.*'q' is unknown"),
        ({"let": {"h": "k", "k": "z"}}, "let 'h' = 'k'.*'k' is unknown"),
        ({"let": {"h k": "z"}}, "let = 'h k': must be an identifier"),
        ({"let": "z"}, "let = 'z': must be a mapping of names to expressions"),
        (
            {"modes": {"flight": Mode({"z": "v", "v": "-g - 2*Max(z, a)"})}},
            r"mode 'flight' = 'Max\(z, a\)': must be of Max and Min of parameters alone.*a transition where the two",
        ),
        (
            {"transitions": transition(event="Min(z, v)")},
            r"transition 'impact' = 'Min\(z, v\)': must be of Max and Min",
        ),
        ({"outputs": {"gap": "Max(z)"}}, "must be an expression in which Max has 2 or more argument"),
        ({"regimes": ["up"]}, r"regimes = \['up'\]: must be a mapping of names to sequences"),
    ],
)
def test_each_fault_of_a_definition_is_named(changes, message):
    with pytest.raises(DefinitionError, match=message):
        make(**changes)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"gg": 1.0}, "parameter = 'gg': must be one of g, e, a, w; did you mean 'g'"),
        ({"g": math.nan}, "g = nan: must be a finite number"),
        ({"g": math.inf}, "g = inf: must be a finite number"),
        ({"g": "one"}, "g = 'one': must be a finite number"),
        ({"g": "1.5"}, "g = '1.5': must be a finite number"),
        ({"g": True}, "g = True: must be a finite number"),
        ({"g": None}, "g = None: must be a finite number"),
        ({3: 1.0}, "a name in parameters = 3: must be text"),
        ("abc", "parameters = 'abc': must be a mapping of names to numbers, or None"),
        ([1.0], r"parameters = \[1.0\]: must be a mapping"),
        ({"g": 0.0}, "g = 0.0: must be > 0"),
        ({"e": -0.1}, "e = -0.1: must be between 0 and 1"),
        ({"a": -1.0}, "a = -1.0: must be >= 0"),
    ],
)
def test_each_unusable_parameter_is_named(parameters, message):
    system = make(positive=("g",), parameter_bounds={"e": (0.0, 1.0), "a": (0.0, math.inf)})
    with pytest.raises(InputError, match=message):
        system.parameter_vector(parameters)


def test_default_parameters_are_checked_as_well():
    with pytest.raises(InputError, match="g = -1.0: must be > 0"):
        make(parameters={"g": -1.0, "e": 0.5, "a": 1.2, "w": 1.0}, positive=("g",))


@pytest.mark.parametrize(
    ("x0", "message"),
    [
        ([1.0], r"x0 = \[1.0\]: must be of shape \(2,\), one number for each of z, v"),
        ([1.0, 2.0, 3.0, 4.0], "x0 = .*must be of shape"),
        ([1.0, math.nan], "x0 = .*must be finite"),
        (["a", 1.0], "x0 = .*must be numbers"),
    ],
)
def test_each_unusable_state_is_told(x0, message):
    with pytest.raises(InputError, match=message):
        make().full_state(x0)


def test_state_without_the_phase_is_at_phase_zero():
    assert make().full_state([1.0, 2.0]).tolist() == [1.0, 2.0, 0.0]
    assert make().full_state([1.0, 2.0, 0.5]).tolist() == [1.0, 2.0, 0.5]


def test_let_names_sub_expressions_of_all_parts():
    system = make(
        let={"table": "a*sin(theta)", "height": "z - table", "pull": sympy.Symbol("g") * 2},
        modes={"flight": Mode({"z": "v", "v": "-pull/2"}, domain="height + 1")},
        transitions=[
            Transition(
                "flight", "flight", event="height", direction=-1,
                reset={"v": "-e*v + (1+e)*a*w*cos(theta)"}, name="impact",
            )
        ],
        outputs={"gap": "1.0e0*height"},
    )  # fmt: skip
    plain, state = make(), [0.7, -0.3, 2.0]
    np.testing.assert_allclose(system.field("flight", state), plain.field("flight", state), rtol=1e-15)
    assert system.transitions[0].event == "(z - (a*sin(theta)))"
    assert system.definition()["outputs"]["gap"]["flight"] == "1.0e0*(z - (a*sin(theta)))"
    assert HybridSystem.from_definition(system.definition()) == system


def test_a_group_sets_its_members():
    system = make(groups={"amplitudes": ("a", "w")})
    assert system.resolve({"amplitudes": 3.0})["w"] == 3.0


def test_regimes_name_motions_and_leave_the_generated_code_as_it_is():
    system = make(regimes={"up": ("flight",)})
    assert system.regimes == {"up": ("flight",)}
    assert pickle.loads(pickle.dumps(system)) == system
    assert system != make()
    assert source_file(FLOW, system) == source_file(FLOW, make())


def test_definition_survives_pickling_and_plain_data():
    system = make()
    assert pickle.loads(pickle.dumps(system)) == system
    assert HybridSystem.from_definition(system.definition()) == system
    assert system != make(outputs={})


def test_sympy_and_text_define_the_same_field():
    v, g = sympy.Symbol("v"), sympy.Symbol("g")
    symbolic = make(modes={"flight": Mode({"z": v, "v": -g})})
    state = [0.3, 0.7, 0.2]
    np.testing.assert_array_equal(symbolic.field("flight", state), make().field("flight", state))


def test_repr_shows_every_equation():
    text = repr(make(name="ball"))
    for part in ("ball", "z' = v", "v' = -g", "theta' = w", "impact: flight -> flight", "v := -e*v", "gap = "):
        assert part in text


@pytest.mark.parametrize("direction", [2, "down", [1]])
def test_a_part_that_cannot_be_used_can_still_be_shown(direction):
    assert f"in direction {direction!r}" in repr(Transition("a", "b", "x", direction))
    assert repr(Transition("a", "b", "x", 1, "v")).endswith("rises through 0, 'v')")
    assert repr(Mode("x")) == "Mode('x')"


def test_notebook_view_shows_the_equations_in_tex():
    page = make()._repr_html_()
    assert r"\dot{z} &amp;= v" in page
    assert r"\mapsto" in page
    assert r"\downarrow 0" in page


def test_names_go_escaped_into_a_notebook():
    attack = "<script>alert(1)</script>"
    system = HybridSystem(
        ("z",),
        {},
        {attack: Mode({"z": "-1"}), "b&b": Mode({"z": "1"}, domain="3 - z")},
        [Transition(attack, "b&b", "z", -1, {"z": "z + 1"}, name=f"{attack} again")],
        name=f"{attack} system",
    )
    page = system._repr_html_()
    assert "<script" not in page
    assert page.count("&lt;script&gt;alert(1)&lt;/script&gt;") == 4
    assert "<code>b&amp;b</code>, where $3 - z &gt; 0$" in page
    assert page.count("<code>") == page.count("</code>") == 3


def test_unknown_mode_suggests_the_nearest():
    with pytest.raises(InputError, match="mode = 'fligt': must be one of flight; did you mean 'flight'"):
        make().field("fligt", [0.0, 0.0])


def test_a_small_drive_of_another_period_is_refused_as_well():
    with pytest.raises(DefinitionError, match="must be of period 2 pi in theta"):
        make(outputs={"drive": "1e-10*sin(theta/2)"})


def test_powers_written_as_decimals_are_clamped_like_fractions():
    fields = []
    for power in ("3/2", "1.5"):
        system = HybridSystem(("z",), {"a": 0.1}, {"m": Mode({"z": f"(a - z)**({power})"})})
        fields.append([system.field("m", [z])[0] for z in (-0.3, 0.0, 0.2)])
    assert fields[0] == fields[1]
    assert fields[0][2] == 0.0


def test_expressions_of_period_two_pi_in_the_phase_are_taken():
    make(outputs={"wave": "cos(3*theta - g) + sin(theta)**2", "sawtooth": "atan2(sin(theta), cos(theta))"})


@pytest.mark.parametrize("build", [systems.afm, lambda: make()])
def test_generated_derivatives_are_central_differences(build):
    system = build()
    compiled, n = system.compiled, len(system.all_states)
    p = system.parameter_vector({})
    rng = np.random.default_rng(7)
    step = 1e-6
    for k in range(len(system.modes)):
        x = rng.uniform(0.1, 0.4, n)
        out = np.empty(2 * n + n * n)
        compiled.call("vary", k, n, np.concatenate([x, np.eye(n).ravel()]), compiled.extended(p), out)
        jacobian = out[n : n + n * n].reshape(n, n)
        for j in range(n):
            shift = np.zeros(n)
            shift[j] = step
            difference = (compiled.field(k, x + shift, p) - compiled.field(k, x - shift, p)) / (2 * step)
            np.testing.assert_allclose(jacobian[:, j], difference, rtol=1e-6, atol=1e-7)
        for j in range(len(p)):
            by_parameter = np.empty(n)
            compiled.call("field_p", k, j, x, compiled.extended(p), by_parameter)
            shift = np.zeros(len(p))
            shift[j] = 1e-6 * max(abs(p[j]), 1e-3)
            difference = (compiled.field(k, x, p + shift) - compiled.field(k, x, p - shift)) / (2 * shift[j])
            np.testing.assert_allclose(
                by_parameter, difference, rtol=1e-5, atol=1e-6 * max(np.abs(difference).max(), 1.0)
            )


def test_event_rates_and_their_gradients_are_central_differences():
    system = make()
    compiled, n = system.compiled, 3
    p = compiled.extended(system.parameter_vector({}))
    x = np.array([0.4, -0.3, 0.9])
    out, other = np.empty(2 + 2 * n), np.empty(2)
    compiled.call("event_x", 0, 0, x, p, out)
    for j in range(n):
        sides = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[j] += sign * 1e-6
            compiled.call("event", 0, 0, moved, p, other)
            sides.append(other.copy())
        np.testing.assert_allclose([out[2 + j], out[2 + n + j]], (sides[0] - sides[1]) / 2e-6, atol=1e-8)
    field = system.field("flight", x)
    assert out[1] == pytest.approx(out[2 : 2 + n] @ field, abs=1e-14)


def test_second_system_of_the_same_mathematics_needs_no_new_file(monkeypatch):
    first = make(name="one")
    monkeypatch.setattr("saltus.system.generated.write_checked", lambda *_: pytest.fail("wrote a file again"))
    second = make(name="two", parameters={"g": 2.0, "e": 0.1, "a": 1.0, "w": 3.0})
    assert source_file(FLOW, second) == source_file(FLOW, first)


def test_greater_and_less_of_parameters_are_piecewise_smooth_in_them():
    system = HybridSystem.smooth(
        {"x": "v", "v": "-Max(k, c, 2)*x - Min(c, 5)*v"}, {"k": 3.0, "c": 1.0}, outputs={"up": "Max(x, 0)"}
    )
    compiled, p = system.compiled, system.parameter_vector({})
    slopes = np.empty((2, 2))
    for j in range(2):
        compiled.call("field_p", 0, j, np.array([0.5, 0.25]), compiled.extended(p), slopes[j])
    assert system.field("smooth", [0.5, 0.25]).tolist() == [0.25, -1.75]
    assert slopes.tolist() == [[0.0, -0.5], [0.0, -0.25]]
    assert system.field("smooth", [0.5, 0.25], parameters={"k": 1e-9, "c": 1e9}).tolist() == [0.25, -0.5e9 - 1.25]
    assert evaluate(system, "up + Min(x, v, 1)", [[0.5, 0.25], [-0.5, 0.25]], 0).tolist() == [0.75, -0.5]
