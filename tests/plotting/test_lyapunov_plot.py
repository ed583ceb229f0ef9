"""Pictures of Lyapunov exponents."""

from __future__ import annotations

import math

import pytest

from oracles.closed_forms import ImpactOrbit
from saltus import Average
from saltus.sweeps.lyapunov import lyapunov_spectrum


def test_curves_are_the_running_estimates_against_periods(impact_oscillator):
    found = lyapunov_spectrum(
        impact_oscillator, {"w": 2.5, "A": 5.4}, [0.0, 0.0], average=Average(periods=100), tolerance=1e-8
    )
    ax = found.plot()
    curves = ax.lines[:2]
    for i, curve in enumerate(curves):
        assert curve.get_ydata() == pytest.approx(found.running[:, i])
        assert curve.get_xdata()[-1] == pytest.approx(100.0)
    assert ax.get_xlabel() == "periods"
    low, high = ax.get_ylim()
    assert low < found.exponents[1] < 0.0 < found.exponents[0] < high


def test_minus_infinity_is_named_and_not_drawn(stick_slip):
    found = lyapunov_spectrum(stick_slip, None, [0.0, 0.3], mode="stick", average=Average(t_end=80.0))
    ax = found.plot()
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts[1] == r"$\lambda_{2} = -\infty$"
    assert all(math.isfinite(edge) for edge in ax.get_ylim())
    assert ax.get_xlabel() == "$t$"


def test_exact_exponent_has_no_error_in_its_name(impact_oscillator):
    # an orbit with real multipliers: every period is like the next
    orbit, U = ImpactOrbit(w=1.1), 3.7
    parameters = {"w": 1.1, "A": orbit.amplitude(U)}
    found = lyapunov_spectrum(
        impact_oscillator, parameters, orbit.after_impact(U), average=Average(periods=40, discard=100), tolerance=1e-13
    )
    exact = found.plot().get_legend().get_texts()
    assert found.errors[0] < 1e-6 * abs(found.exponents[0])
    assert "pm" not in exact[0].get_text()
    assert f"{found.exponents[0]:.6g}" in exact[0].get_text()
    assert found.plot(legend=False).get_legend() is None
