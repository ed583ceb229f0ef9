"""Events that are met so steeply that a rounding of the duration passes the surface, and falls from far away."""

import math
import time

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import saltus
from saltus.orbits.meshes import Decay, crowding, steady
from selection import guarding


def spiking(field, peak, reset, unit=(1.0, 1.0)):
    """One state in units: V = unit[0] v, time = unit[1] t."""
    a, b = unit
    field = f"({field.replace('V', f'(V/{a!r})')})*{a / b!r}"
    spike = saltus.Transition("m", "m", f"V - {peak * a!r}", 1, {"V": repr(reset * a)}, name="spike")
    return saltus.HybridSystem(("V",), {}, {"m": saltus.Mode({"V": field})}, [spike])


@pytest.mark.parametrize("peak", guarding([30.0, 32.0, 33.0, 35.0, 37.0, 45.0, 100.0, 300.0], 30.0, 35.0, 100.0))
def test_the_period_of_an_upstroke_that_no_duration_resolves_is_its_integral(peak):
    orbit = saltus.find_orbit(spiking("exp(V) - V + 2", peak, -2.0), x0=[0.0])
    truth = mp.quad(lambda v: 1 / (mp.e**v - v + 2), [-2, 0, 2, 5, 20, peak])
    assert orbit.period == pytest.approx(float(truth), rel=1e-11)
    assert orbit.admissible
    assert orbit.stable
    assert orbit.max["V"] == pytest.approx(peak, rel=1e-3)


@pytest.mark.parametrize(
    ("peak", "unit"),
    guarding(
        [(1e5, (1.0, 1.0)), (1e6, (1.0, 1.0)), (1e7, (1.0, 1.0)), (1e8, (1.0, 1.0)), (1e9, (1.0, 1.0)),
         (1e6, (1e-9, 1.0)), (1e6, (1.0, 1e-9)), (1e6, (1.0, 1e9))],
        (1e5, (1.0, 1.0)), (1e7, (1.0, 1.0)), (1e6, (1.0, 1e-9)),
    ),
)  # fmt: skip
def test_a_fall_from_far_away_and_back_takes_little_work(peak, unit):
    system = spiking("V**2 + 1", peak, -peak, unit)
    begun = time.process_time()
    orbit = saltus.find_orbit(system, x0=[0.0])
    assert time.process_time() - begun < 30.0
    assert orbit.period == pytest.approx(2.0 * math.atan(peak) * unit[1], rel=1e-11)


@pytest.mark.parametrize("cut", guarding([0.0, 20.0, 40.0, 500.0], 20.0))
def test_a_neuron_with_the_usual_cut_has_the_period_of_a_motion(cut):
    rise = "(-30*(V + 70.6) + 60*exp((V + 50.4)/2) - w + 800)/281"
    spike = saltus.Transition("m", "m", f"V - {cut}", 1, {"V": "-70.6", "w": "w + 80.5"}, name="spike")
    modes = {"m": saltus.Mode({"V": rise, "w": "(4*(V + 70.6) - w)/144"})}
    orbit = saltus.find_orbit(saltus.HybridSystem(("V", "w"), {}, modes, [spike]), x0=[-70.0, 0.0])

    def field(t, x):
        V, w = x
        return [(-30 * (V + 70.6) + 60 * np.exp((V + 50.4) / 2) - w + 800) / 281, (4 * (V + 70.6) - w) / 144]

    def top(t, x):
        return x[0] + 10.0

    top.terminal, w = True, 286.0
    for _ in range(30):
        run = solve_ivp(field, (0, 500), [-70.6, w], events=top, rtol=1e-12, atol=1e-12, method="DOP853")
        w = run.y[1, -1] + 80.5
    # what is left of the rise from -10 on: exp((V + 50.4)/2) is 6e8
    rest = 281 / 60 * 2.0 * (math.exp(-20.2) - math.exp(-(cut + 50.4) / 2))
    assert orbit.period == pytest.approx(run.t[-1] + rest, rel=1e-10)
    assert orbit.max["V"] == pytest.approx(cut, abs=1e-2)
    assert orbit.x0[1] == pytest.approx(w, abs=1e-6)
    assert orbit.residual < 1e-3


def test_steps_are_cut_for_the_decay_where_they_are():
    mesh = np.linspace(0.0, 1.0, 11)
    decay = Decay(np.array([0.0, 0.1, 0.5, 1.0]), np.array([1e7, 1e2, 10.0, 10.0]))
    cut = steady(mesh, decay)
    assert crowding(mesh, np.array([0, 11]), [1e7]) == [0]
    assert crowding(mesh, np.array([0, 11]), [decay]) == []
    assert np.sum(cut <= 0.1) > 100_000  # the fast decay ends with the first step
    assert np.sum(cut > 0.1) < 40
    assert steady(mesh, Decay(np.array([0.0, 1.0]), np.array([50.0, 50.0]))) == pytest.approx(steady(mesh, 50.0))
