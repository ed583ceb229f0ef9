"""The phase plane: modes, directions, nullclines and event surfaces, against what is known of them by hand."""

import numpy as np
import pytest

import saltus
from saltus.errors import InputError
from saltus.explorer.plane import Window, directions, full_start, modes_on, nullclines, surfaces
from saltus.flow import simulate
from systems import ball_on_table


def relay() -> saltus.HybridSystem:
    """Return a relay that switches at x + 0.2*v = 0, with a drive that no state sees."""
    modes = {"plus": saltus.Mode({"x": "v", "v": "a - v"}), "minus": saltus.Mode({"x": "v", "v": "-a - v"})}
    switches = [
        saltus.Transition("plus", "minus", "x + 0.2*v", 1, name="off"),
        saltus.Transition("minus", "plus", "x + 0.2*v", -1, name="on"),
    ]
    return saltus.HybridSystem(("x", "v"), {"a": 0.5}, modes, switches)


def window(system, **given) -> Window:
    """Return a window of the plane of both states about 0."""
    start = full_start(system, [0.0, 0.0])
    return Window((system.states[0], system.states[1]), (-1.0, 1.0), (-2.0, 2.0), start, given)


def test_a_place_has_the_mode_in_which_a_motion_starts_there():
    system = relay()
    states = np.array([[0.5, 0.3], [-0.5, 0.3], [0.1, -1.0], [-0.1, 1.0]])
    told = [system.mode_names[k] for k in modes_on(system, states, {})]
    starts = [str(simulate(system, {}, x0, t_end=1e-6).mode_at(0.0)) for x0 in states.tolist()]
    assert told == starts == ["minus", "plus", "plus", "minus"]


def test_arrows_lie_along_the_field():
    system = relay()
    xs, ys, modes = directions(system, window(system), (300.0, 150.0))
    assert len(xs) == len(ys) == len(modes) == 22 * 16
    for x, y, mode in list(zip(xs, ys, modes, strict=True))[::29]:
        middle = (x[0] + x[1]) / 2.0, (y[0] + y[1]) / 2.0
        rate = system.field(system.mode_names[mode], middle)
        along = np.array([x[1] - x[0], y[1] - y[0]])
        assert along @ rate == pytest.approx(np.linalg.norm(along) * np.linalg.norm(rate))
    lengths = [np.hypot((x[1] - x[0]) * 150.0, (y[1] - y[0]) * 37.5) for x, y in zip(xs, ys, strict=True)]  # pixels
    assert np.ptp(lengths) == pytest.approx(0.0, abs=1e-9)


def test_nullclines_are_cut_where_the_mode_ends():
    system = relay()
    found = list(nullclines(system, window(system)))
    of_x = np.vstack([curve for number, curve in found if number == 0])
    assert np.ptp(of_x[:, 0]) == pytest.approx(2.0)
    assert of_x[:, 1] == pytest.approx(0.0, abs=1e-12)
    for _, curve in ((number, curve) for number, curve in found if number == 1):
        level = curve[0, 1]
        assert curve[:, 1] == pytest.approx(level)
        assert abs(level) == pytest.approx(0.5)
        assert np.all(np.sign(curve[:, 0] + 0.2 * curve[:, 1]) == -np.sign(level))
    assert sum(number == 1 for number, _ in found) == 2


def test_values_of_parameters_count():
    system = relay()
    levels = {round(float(curve[0, 1]), 9) for number, curve in nullclines(system, window(system, a=1.25)) if number}
    assert levels == {1.25, -1.25}


def test_the_surface_of_two_transitions_is_drawn_once():
    system = relay()
    ((names, event, curve),) = surfaces(system, window(system))
    assert (names, event) == ("off, on", "x + 0.2*v")
    assert curve[:, 0] + 0.2 * curve[:, 1] == pytest.approx(0.0, abs=1e-12)


def test_a_surface_moves_with_the_phase():
    system = ball_on_table()
    start = {"z": 0.0, "v": 0.0, "theta": np.pi / 2.0}
    there = Window(("z", "v"), (-2.0, 2.0), (-2.0, 2.0), start, {"a": 1.3})
    ((_, _, curve),) = surfaces(system, there)
    assert curve[:, 0] == pytest.approx(1.3)


def test_a_jump_is_no_zero():
    friction = saltus.HybridSystem(("x", "v"), {}, {"all": saltus.Mode({"x": "v", "v": "-x - 3*sign(v)"})})
    found = [curve for number, curve in nullclines(friction, window(friction)) if number == 1]
    assert found == []  # v' = -3 or 3 about v = 0, and x is at most 1


def test_an_unknown_name_is_told():
    with pytest.raises(InputError):
        list(nullclines(relay(), window(relay(), b=1.0)))
