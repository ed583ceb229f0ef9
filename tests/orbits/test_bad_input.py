"""What `solve_orbit` refuses, by the text of the message."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import systems
from saltus import ConvergenceError, InputError, solve_orbit

GOOD = ("free", "impact", [1.0, -1.35658635, 0.07595216], 2.0 * math.pi)


@pytest.fixture(scope="module")
def oscillator():
    return systems.impact_oscillator()


def refuse(message):
    return pytest.raises(InputError, match=f"^{re.escape(message)}$")


def changed(**parts):
    names = ("mode", "transition", "x0", "duration")
    return [tuple(parts.get(name, value) for name, value in zip(names, GOOD, strict=True))]


@pytest.mark.parametrize(("name", "hint"), [("aa", ""), ("w0", "; did you mean 'w'?")])
def test_unknown_parameter(oscillator, name, hint):
    with refuse(f"parameter = {name!r}: must be one of k, c, d, e, w, A{hint}"):
        solve_orbit(oscillator, {name: 1.0}, [GOOD])


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (math.nan, "A = nan: must be a finite number"),
        (math.inf, "A = inf: must be a finite number"),
        ("x", "A = 'x': must be a finite number"),
        (None, "A = None: must be a finite number"),
    ],
)
def test_parameters_that_are_no_numbers(oscillator, value, message):
    with refuse(message):
        solve_orbit(oscillator, {"A": value}, [GOOD])


def test_no_segments(oscillator):
    wanted = "segments=[(mode, transition, x0, duration), ...], or x0=... and period=... of a smooth orbit"
    with refuse(f"guess = None: must be {wanted}"):
        solve_orbit(oscillator)
    with refuse("segments = (): must be one (mode, transition, x0, duration) or more"):
        solve_orbit(oscillator, {}, ())


@pytest.mark.parametrize("segment", [("free", "impact", [1.0, -1.0]), "free", 3, None])
def test_a_segment_of_another_make(oscillator, segment):
    with refuse(f"segments[0] = {segment!r}: must be (mode, transition, x0, duration)"):
        solve_orbit(oscillator, {}, [segment])


def test_unknown_mode(oscillator):
    with refuse("mode = 'fre': must be one of free; did you mean 'free'?"):
        solve_orbit(oscillator, {}, changed(mode="fre"))


@pytest.mark.parametrize(("name", "hint"), [("impakt", "; did you mean 'impact'?"), ("zzz", "")])
def test_unknown_transition(oscillator, name, hint):
    with refuse(f"segments[0] transition = {name!r}: must be a transition out of 'free': impact, theta{hint}"):
        solve_orbit(oscillator, {}, changed(transition=name))


def test_a_transition_out_of_another_mode():
    segments = [("slip", "release", [1.0, 0.3], 4.2), ("stick", "catch", [0.0, 0.3], 3.3)]
    with refuse("segments[0] transition = 'release': must be a transition out of 'slip': catch"):
        solve_orbit(systems.stick_slip(), {}, segments)


def test_segments_that_do_not_follow_each_other():
    with refuse("segments[0] mode = 'slip': must be 'stick', where 'catch' leads"):
        solve_orbit(systems.stick_slip(), {}, [("slip", "catch", [1.0, 0.3], 4.2)])


@pytest.mark.parametrize("duration", [0.0, -1.0, math.nan, math.inf, "long", None])
def test_durations(oscillator, duration):
    with refuse(f"segments[0] duration = {duration!r}: must be a finite number > 0"):
        solve_orbit(oscillator, {}, changed(duration=duration))


@pytest.mark.parametrize("x0", [[1.0], [1.0, 2.0, 3.0, 4.0], [], 1.0])
def test_states_of_another_length(oscillator, x0):
    fits = "of shape (2,), one number for each of x, v, or (3,) with the phase theta"
    with refuse(f"segments[0] x0 = {x0!r}: must be {fits}"):
        solve_orbit(oscillator, {}, changed(x0=x0))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_states_that_are_not_finite(oscillator, bad):
    with refuse(f"segments[0] x0 = [1.0, {bad!r}]: must be finite"):
        solve_orbit(oscillator, {}, changed(x0=[1.0, bad]))


def test_states_that_are_no_numbers(oscillator):
    with pytest.raises(InputError, match=r"^segments\[0\] x0 = .*: must be numbers, one for each of x, v$"):
        solve_orbit(oscillator, {}, changed(x0=["a", 1.0]))


@pytest.mark.parametrize("share", [0.3, 0.49])
def test_durations_that_make_no_forcing_period(oscillator, share):
    duration = share * 2.0 * math.pi
    wanted = (
        "must be durations that sum to a whole number of forcing periods, at least one; the forcing period is 6.28319"
    )
    with refuse(f"segments = {duration!r}: {wanted}"):
        solve_orbit(oscillator, {}, changed(duration=duration))


def test_the_event_less_segment_comes_last(oscillator):
    segments = [("free", "theta", [0.9, 1.0], 3.1), ("free", "impact", [1.0, -1.3, 3.1], 3.2)]
    with refuse("segments = ['theta', 'impact']: must be a transition for each segment but the last"):
        solve_orbit(oscillator, {}, segments)


def test_a_guess_far_from_any_orbit_is_told_in_words():
    far = [("down", "switch_up", [50.0, -30.0, 0.0], 0.01), ("up", "switch_down", [9.0, 9.0, 0.0], 0.01)]
    with pytest.raises(
        ConvergenceError,
        match=r"^(periodic orbit|flow of a segment): no convergence, residual .* after \d+ iterations; .+",
    ):
        solve_orbit(systems.relay(), {}, far)


@pytest.mark.parametrize("tol", [0.0, -1e-9, math.nan, "fine", 2.0])
def test_tolerance(oscillator, tol):
    with pytest.raises(InputError, match=rf"^tolerance = {re.escape(repr(tol))}: must be "):
        solve_orbit(oscillator, {}, [GOOD], tolerance=tol)


def test_numpy_numbers_are_numbers(oscillator):
    orbit = solve_orbit(oscillator, {"A": np.float64(1.0)}, changed(x0=np.array(GOOD[2]), duration=np.float64(GOOD[3])))
    assert orbit.residual < 1e-12
