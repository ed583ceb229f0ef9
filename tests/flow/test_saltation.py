"""Saltation matrices against finite differences of the flow, and against known multipliers."""

from __future__ import annotations

import numpy as np
import pytest

import systems
from saltus.errors import InputError
from saltus.flow.event_logs import events_after
from saltus.flow.saltation import saltation_matrix
from systems import settle


@pytest.mark.parametrize(
    ("make", "parameters", "start", "mode"),
    [
        (systems.afm, {}, [0.0, 0.0], 0),
        (systems.ball_on_table, {}, [2.0, 0.1], 0),
        (systems.two_fields, {}, [-1.0, 0.3], 0),
        (systems.relay, {}, [0.1, 0.0, 0.5], 0),
        (systems.stick_slip, {}, [1.0, 0.3], 0),
    ],
)
def test_saltation_is_the_derivative_of_the_flow_across_the_event(make, parameters, start, mode):
    system = make()
    p = system.parameter_vector(parameters)
    compiled, tight = system.compiled, {"tolerance": (1e-13, 1e-15)}
    log = events_after(system, p, start, mode, t_end=100.0, n_events=1, **tight)
    before, k = log.x_before[-1], int(log.transition[-1])
    source, target = int(log.mode_before[-1]), int(log.mode_after[-1])
    f1, f2 = compiled.field(source, before, p), compiled.field(target, log.x_after[-1], p)
    n = before.size

    def quotient(tau):
        """Differences of the flow over 2 tau, from tau before the event."""

        def end(x):
            return settle(system, p, x, source, t_end=2.0 * tau, **tight)[0]

        x = before - tau * f1
        return np.column_stack([(end(x + step) - end(x - step)) / 2e-6 for step in 1e-6 * np.eye(n)])

    extrapolated = 2.0 * quotient(5e-5) - quotient(1e-4)
    saltation = saltation_matrix(system, parameters, system.transition_names[k], before)
    assert saltation == pytest.approx(extrapolated, abs=1e-3 * max(1.0, np.abs(saltation).max()))
    assert saltation @ f1 == pytest.approx(f2, abs=1e-10 * max(1.0, np.abs(f2).max()))


def test_ball_on_a_table_has_the_closed_form_determinant(ball_on_table):
    e, a, theta, v = 0.5, 1.1, 0.7, -2.0
    saltation = saltation_matrix(ball_on_table, {"a": a, "e": e}, "impact", [a * np.sin(theta), v, theta])
    assert np.linalg.det(saltation) == pytest.approx(e * e * 1.0, rel=1e-12)


def test_two_fields_have_the_known_multiplier(two_fields):
    from scipy.integrate import solve_ivp
    from scipy.linalg import eigvals

    p = two_fields.parameter_vector({"al": 1.0, "be": 2.0})
    x, mode = settle(two_fields, p, [0.0, 1.5], 0, t_end=150.0, tolerance=(1e-13, 1e-15))
    log = events_after(two_fields, p, x, mode, t_end=100.0, n_events=3, tolerance=(1e-13, 1e-15))
    monodromy = np.eye(2)
    for i in (0, 1):
        mode, start, length = int(log.mode_after[i]), log.x_after[i], log.time[i + 1] - log.time[i]

        def field(t, y, mode=mode):
            return two_fields.compiled.field(mode, y, p)

        columns = []
        for j in range(2):
            ends = [
                solve_ivp(field, (0.0, length), start + step, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
                for step in (1e-5 * np.eye(2)[j], -1e-5 * np.eye(2)[j])
            ]
            columns.append((ends[0] - ends[1]) / 2e-5)
        name = two_fields.transition_names[log.transition[i + 1]]
        saltation = saltation_matrix(two_fields, {"al": 1.0, "be": 2.0}, name, log.x_before[i + 1])
        monodromy = saltation @ np.column_stack(columns) @ monodromy
    assert np.sort(eigvals(monodromy).real) == pytest.approx([0.002430511407, 1.0], abs=1e-8)


def test_grazing_has_no_saltation_matrix(ball):
    with pytest.raises(InputError, match=r"normal velocity at transition 'impact' = .*: must be different from 0; the"):
        saltation_matrix(ball, None, "impact", [0.0, 0.0])


def test_an_unknown_transition_is_named(ball):
    with pytest.raises(InputError, match=r"transition = 'impct': must be one of impact; did you mean 'impact'?"):
        saltation_matrix(ball, None, "impct", [0.0, -1.0])


def test_a_state_of_the_wrong_length_is_refused(ball):
    with pytest.raises(InputError, match=r"x_before = \[0.0\]: must be of shape \(2,\)"):
        saltation_matrix(ball, None, "impact", [0.0])
