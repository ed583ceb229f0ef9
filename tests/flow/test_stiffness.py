"""Motions that are stiff: against closed forms, from either kind of steps."""

import ctypes

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import Average, HybridSystem, Mode, Transition, find_orbit, load, lyapunov_spectrum, run_sweep, simulate
from saltus.errors import ConvergenceError, StiffnessError
from saltus.flow import radau
from saltus.flow.stiffness import may_be_implicit
from saltus.options import SweepOptions


def forced(k: float) -> HybridSystem:
    """Return x'' + k x' + k x = k cos s."""
    return HybridSystem(
        ("x", "v"), {"k": k, "w": 1.0}, {"m": Mode({"x": "v", "v": "-k*(v - cos(s)) - k*x"})}, phase=("s", "w")
    )


def test_weights_of_the_method_integrate_polynomials():
    for power in range(7):
        np.testing.assert_allclose(
            radau.WEIGHTS @ radau.NODES**power, radau.NODES ** (power + 1) / (power + 1), atol=1e-15
        )
    for power in range(13):
        assert radau.WEIGHTS[-1] @ radau.NODES**power == pytest.approx(1.0 / (power + 1), abs=1e-15)
    assert abs(radau.WEIGHTS[-1] @ radau.NODES**13 - 1.0 / 14.0) > 1e-9


def test_the_dense_output_is_the_polynomial_through_the_stages():
    increments = np.array([c - 2.0 * c**3 + 0.5 * c**7 for c in radau.NODES])
    coefficients, value = radau.DENSE @ increments, 0.0
    for k in range(6, -1, -1):
        value = (value + coefficients[k]) * (0.3 if k % 2 == 0 else 0.7)
    assert value == pytest.approx(0.3 - 2.0 * 0.3**3 + 0.5 * 0.3**7, abs=1e-14)
    # the shifted Legendre polynomial of degree 7 has the leading coefficient 3432
    assert radau.LAST @ increments == pytest.approx(0.5 / 3432.0, rel=1e-10)


@pytest.mark.parametrize("place", [0.24, 0.45, 0.66, 0.85])
def test_what_a_step_passes_over_between_its_stages_is_told(place):
    """A state held at a pulse that no stage sees is off by its height, 1: d = h R counts as 5, (1 + h R / 5)^-1 d."""
    from saltus.flow.kernels.implicit_segment import check

    system = HybridSystem.smooth(
        {"x": "-R*(x - A*exp(K*(cos(s - C) - 1)))"}, {"R": 1e6, "A": 1.0, "C": place, "K": 1e4}, phase=("s", "1")
    )
    increments = np.column_stack([np.zeros(7), radau.NODES])  # at rest, while the phase goes on by 1
    curve, x = np.ascontiguousarray(radau.DENSE @ increments).ravel(), np.zeros(2)
    doubles, integers = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int64)
    kinds = [integers, ctypes.c_int64, ctypes.c_int64, doubles, *[ctypes.c_double] * 3, doubles, doubles]
    called = ctypes.CFUNCTYPE(ctypes.c_double, *kinds, ctypes.c_double, ctypes.c_double)(check.address)
    functions = system.compiled.addresses

    def told(height):
        p = system.compiled.extended(system.parameter_vector({"A": height}))
        given = p.ctypes.data_as(doubles), 1.0, -1.0, 1.0, x.ctypes.data_as(doubles), curve.ctypes.data_as(doubles)
        return called(functions.ctypes.data_as(integers), 0, 2, *given, 1e-9, 1e-9)

    assert told(0.0) < 1e-9
    assert told(1.0) == pytest.approx(5.0 / 1e4 / 1e-9, rel=1e-4)


@pytest.mark.parametrize("k", [1e3, 1e6, 1e10])
def test_a_forced_linear_motion_comes_to_its_exact_response(k):
    motion = simulate(forced(k), {}, [1.0, 0.0], periods=8)
    response = k / (k - 1.0 + 1j * k)
    np.testing.assert_allclose(motion.x_end[:2], [response.real, (1j * response).real], atol=1e-8)
    assert motion.step_times.size < 10_000


@pytest.mark.parametrize("lag", [1e-3, 1e-6])
def test_events_of_a_stiff_motion_happen_when_they_are_due(lag):
    system = HybridSystem(
        ("x", "y"), {"lag": lag},
        {"up": Mode({"x": "1 - x", "y": "(x - y)/lag"}), "down": Mode({"x": "-1 - x", "y": "(x - y)/lag"})},
        [Transition("up", "down", "y - 0.5", 1), Transition("down", "up", "y + 0.5", -1)],
    )  # fmt: skip
    motion = simulate(system, {}, [0.0, 0.0], t_end=40.0)
    times = np.asarray(motion.events["time"])
    a = np.tanh(np.diff(times)[-1] / 2.0)
    due = 1.0 - (1.0 + a) * np.exp(-np.diff(times)[-1]) / (1.0 - lag)
    assert due == pytest.approx(0.5, abs=1e-8)
    np.testing.assert_allclose(np.diff(times)[-6:], np.diff(times)[-1], atol=1e-8)


def test_a_slow_exponent_of_a_stiff_motion_is_exact_and_a_fast_one_collapses():
    for k in (1e2, 1e8):
        found = lyapunov_spectrum(forced(k), {}, [0.0, 0.0], average=Average(periods=40)).exponents
        assert found[0] == pytest.approx(np.roots([1.0, k, k]).real.max(), abs=1e-7)
        assert (
            found[1] == pytest.approx(np.roots([1.0, k, k]).real.min(), abs=1e-4) if k == 1e2 else found[1] == -np.inf
        )


def test_a_sweep_goes_through_stiff_values():
    sweep = run_sweep(forced(1.0), "k", [1e2, 1e5, 1e8], x0=[0.0, 0.0], options=SweepOptions(discard=20, keep=3))
    assert set(sweep.labels.ravel().tolist()) == {"period-1"}


def test_growth_behind_a_slow_decay_is_followed():
    """A motion beside an unstable slow manifold leaves it when it is due: no step damps the growth."""
    system = HybridSystem.smooth({"x": "1", "y": "k*(x*y - y**3) + 1"}, {"k": 1e3})
    stiff = simulate(system, {}, [-1.0, 0.1], t_end=2.0)
    found = solve_ivp(
        lambda _, u: [1.0, 1e3 * (u[0] * u[1] - u[1] ** 3) + 1.0], (0.0, 2.0), [-1.0, 0.1], method="Radau", rtol=1e-11,
        atol=1e-13,
    )  # fmt: skip
    np.testing.assert_allclose(stiff.x_end, found.y[:, -1], rtol=1e-8)


def test_a_state_that_grows_again_from_what_is_left_keeps_explicit_steps():
    """y = y0 exp(k (x^2 - x0^2)/2) comes back to y0 after it was as small as exp(-30)."""
    system = HybridSystem.smooth({"x": "1", "y": "k*x*y"}, {"k": 60.0})
    end = simulate(system, {}, [-1.0, 1.0], t_end=2.0, tolerance=(1e-12, 1e-30)).x_end
    assert end[1] == pytest.approx(1.0, rel=1e-8)
    compiled = system.compiled
    p = compiled.extended(system.parameter_vector({}))
    assert not may_be_implicit(compiled, 0, np.array([-1.0, 1.0]), p, 2)
    held = HybridSystem.smooth({"x": "0", "y": "x - y"}, {})
    assert may_be_implicit(held.compiled, 0, np.array([1.0, 2.0]), np.zeros(0), 2)


def test_a_stiff_motion_at_rest_takes_steps_of_finite_length():
    system = HybridSystem.smooth({"x": "1 - x", "y": "1e5*(x - y)"}, {})
    end = simulate(system, {}, [0.0, 0.0], t_end=1e6)
    np.testing.assert_allclose(end.x_end, [1.0, 1.0], rtol=1e-9)
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_orbit(system, x0=[0.0, 0.0])


def test_a_motion_tells_how_many_steps_were_implicit(tmp_path):
    slow, fast = (simulate(forced(k), {}, [1.0, 0.0], periods=4) for k in (10.0, 1e6))
    assert slow.implicit_steps == 0
    assert "implicit" not in repr(slow)
    assert 0 < fast.implicit_steps < fast.step_times.size
    assert f"{fast.implicit_steps} of them implicit" in repr(fast)
    fast.save(tmp_path / "fast.nc")
    assert load(tmp_path / "fast.nc").implicit_steps == fast.implicit_steps


@pytest.mark.campaign
def test_a_decay_that_no_steps_may_follow_is_told_with_its_rate():
    """y returns at the rate 2e7 to a slow turn, and its zeros are an invariant plane."""
    system = HybridSystem(
        ("x", "v", "y"), {"k": 1e7, "w": 1.0}, {"m": Mode({"x": "v", "v": "cos(s) - x - v", "y": "k*y*(2 + x - y)"})},
        phase=("s", "w"),
    )  # fmt: skip
    with pytest.raises(
        StiffnessError, match=r"fastest rate there is \d\.?\d*e\+07, a decay that implicit steps may not"
    ):
        find_orbit(system, x0=[0.0, 0.0, 1.0])
