"""Tapping mode: its field against Newton's law in SI units, its surface, its parameters, and what is refused."""

import subprocess
import sys

import numpy as np
import pytest

from saltus.afm import Cantilever, Setup, table1, tapping_mode, tip_force
from saltus.errors import InputError

EPS = np.finfo(float).eps
QUADRATURE_B = np.array([1.565983512079251, -0.8678717902214385, 0.5088505937322114, -0.3637960432740972])
"""B_i by quadrature of the textbook's mode shapes in 40 digits (mpmath)."""


def newtons_law(setup, state, *, Omega, ybar, D, static_sign=1.0):
    """Derivative of (q, v, theta) from forces in newtons on the modal mass, made dimensionless at the end."""
    n = len(state) // 2
    mass, omega_1, eta = setup.cantilever.mass, setup.cantilever.omega_1, setup.eta
    u, velocity, theta = state[:n] * eta, state[n : 2 * n] * eta * omega_1, state[-1]
    shake, drive = ybar * eta, Omega * omega_1
    pull_at_rest = tip_force(eta, setup.sample)
    pull = tip_force(eta - u.sum() - shake * np.sin(theta), setup.sample)
    spring = setup.cantilever.stiffnesses(n) * u
    drag = mass * omega_1 * D * velocity
    inertia = mass * QUADRATURE_B[:n] * drive**2 * shake * np.sin(theta)
    acceleration = (static_sign * pull_at_rest - pull - spring - drag + inertia) / mass
    return np.concatenate([state[n : 2 * n], acceleration / (eta * omega_1**2), [Omega]])


def state_with_gap(rng, n, gap, theta, ybar):
    """Random state whose gap is `gap`."""
    q, v = rng.normal(size=n), rng.normal(size=n)
    q += (1.0 - gap - ybar * np.sin(theta) - q.sum()) / n
    return np.concatenate([q, v, [theta]])


@pytest.fixture(scope="module")
def systems():
    return {n: tapping_mode(table1(), n) for n in (1, 2, 4)}


@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize(
    ("mode", "gaps"), [("flight", (0.004, 0.05, 0.7, 3.0)), ("contact", (0.0033, 0.0, -0.01, -0.3))]
)
def test_field_is_newtons_law_in_si_units(systems, n, mode, gaps):
    rng = np.random.default_rng(20230418)
    damping = {"flight": 0.03, "contact": 3.5}[mode] * (1.0 + np.arange(n))
    values = {"Omega": 1.07, "ybar": 0.2} | {
        f"{'D_att' if mode == 'flight' else 'D_rep'}_{i + 1}": damping[i] for i in range(n)
    }
    for gap in gaps:
        state = state_with_gap(rng, n, gap, rng.uniform(0.0, 6.0), 0.2)
        expected = newtons_law(table1(), state, Omega=1.07, ybar=0.2, D=damping)
        np.testing.assert_allclose(systems[n].field(mode, state, parameters=values), expected, rtol=1e-12, atol=1e-11)


def test_static_term_as_printed_is_the_other_sign():
    printed = tapping_mode(table1(), 2, static_term="as-printed")
    state = np.array([0.3, -0.05, 0.2, 0.1, 0.4])
    for mode, damping in (("flight", 0.025), ("contact", 4.0)):
        state[0] += 1.0 if mode == "contact" else 0.0
        expected = newtons_law(table1(), state, Omega=1.0, ybar=0.108, D=damping, static_sign=-1.0)
        np.testing.assert_allclose(printed.field(mode, state), expected, rtol=1e-12, atol=1e-12)


def test_rest_is_an_equilibrium_without_drive(systems):
    assert np.abs(systems[2].field("flight", np.zeros(5), parameters={"ybar": 0.0})[:4]).max() == 0.0


def test_rest_is_no_equilibrium_as_printed():
    printed = tapping_mode(table1(), 2, static_term="as-printed").field("flight", np.zeros(5), parameters={"ybar": 0.0})
    np.testing.assert_allclose(printed, [0.0, 0.0, 2 * 2.35038841e-6, 2 * 2.35038841e-6, 1.0], rtol=3e-9)


def test_fields_differ_at_the_surface_by_the_damping_alone(systems):
    rng = np.random.default_rng(7)
    state = state_with_gap(rng, 2, 1.0 / 300.0, 1.0, 0.108)
    jump = systems[2].field("contact", state) - systems[2].field("flight", state)
    # The gap is met to 1e-16, the attraction's slope there is 130, and contact takes the gap to the power 3/2.
    np.testing.assert_allclose(jump, [0.0, 0.0, *(0.025 - 4.0) * state[2:4], 0.0], rtol=0.0, atol=1e-12)


def test_physical_parameters_act_as_a_new_set_up(systems):
    setup = table1()
    values = {"eta": 45e-9, "a0": 3e-10, "E_star": 5e9, "R": 12e-9, "H": 1e-19}
    sample = type(setup.sample)(**{name: value for name, value in values.items() if name != "eta"})
    other = tapping_mode(Setup(setup.cantilever, sample, values["eta"]), 2)
    for mode, state in (("flight", [0.1, 0.02, 0.5, -0.5, 2.0]), ("contact", [1.1, 0.02, 0.5, -0.5, 2.0])):
        np.testing.assert_array_equal(systems[2].field(mode, state, parameters=values), other.field(mode, state))


@pytest.mark.parametrize(("mode", "q1"), [("flight", 0.4), ("contact", 1.2)])
def test_outputs_are_gap_its_rate_and_force_in_units_of_eta_omega_1_and_k_eta(systems, mode, q1):
    setup, system = table1(), systems[2]
    state, out = np.array([q1, -0.1, 0.3, 0.2, 0.5]), np.empty(3)
    p = system.compiled.extended(system.parameter_vector({"Omega": 1.07}))
    system.compiled.call("outputs", system.mode_index(mode), 0, state, p, out)
    gap = 1.0 - q1 + 0.1 - 0.108 * np.sin(0.5)
    ahead = state + 1e-6 * system.field(mode, state, parameters={"Omega": 1.07})
    back = state - 1e-6 * system.field(mode, state, parameters={"Omega": 1.07})
    rate = (back[:2].sum() + 0.108 * np.sin(back[-1]) - ahead[:2].sum() - 0.108 * np.sin(ahead[-1])) / 2e-6
    unit = setup.cantilever.k * setup.eta
    np.testing.assert_allclose(out[[0, 2]], [gap, tip_force(gap * setup.eta, setup.sample) / unit], rtol=1e-13)
    assert out[1] == pytest.approx(rate, abs=1e-9)  # of a central difference: rounding over its step


def test_states_are_all_positions_then_all_velocities(systems):
    assert systems[4].states == ("q1", "q2", "q3", "q4", "v1", "v2", "v3", "v4")
    assert systems[4].phase == ("theta", "Omega")
    assert systems[1].name == "tapping-mode AFM, 1 mode"


def test_tip_touches_as_the_gap_falls_to_a0_and_is_released_as_it_rises(systems):
    touch, release = systems[2].transitions
    assert (touch.name, touch.source, touch.target, touch.direction) == ("touch", "flight", "contact", -1)
    assert (release.name, release.source, release.target, release.direction) == ("release", "contact", "flight", 1)
    for event in (touch.event, release.event):
        place = {"q1": 0.7, "q2": 0.2, "theta": 1.5, "ybar": 0.1, "eta": 60e-9, "a0": 2e-10, "sin": np.sin}
        assert eval(event, place) == pytest.approx(0.1 - 0.1 * np.sin(1.5) - 1.0 / 300.0, rel=1e-12)
    assert touch.reset == release.reset == {}


def test_defaults_are_those_of_the_paper(systems):
    assert systems[2].parameters == {
        "Omega": 1.0, "ybar": 0.108, "D_att_1": 0.025, "D_att_2": 0.025, "D_rep_1": 4.0, "D_rep_2": 4.0,
        "k": pytest.approx(1.9434665), "eta": 60e-9, "a0": 2e-10, "E_star": 10.4e9, "R": 20e-9, "H": 2.96e-19,
    }  # fmt: skip


def test_measured_quality_factor_damps_every_mode():
    lever = Cantilever.from_measured(k=2.0, f0=70e3, Q=200.0)
    system = tapping_mode(Setup(lever, table1().sample, 60e-9), 2)
    assert (system.parameters["D_att_1"], system.parameters["D_att_2"]) == (0.005, 0.005)
    assert system.parameters["D_rep_2"] == 4.0


def test_parameters_replace_defaults_and_groups_set_all_modes():
    system = tapping_mode(table1(), 2, parameters={"D_rep": 3.0, "D_rep_2": 2.0, "Omega": 1.15})
    assert system.parameters["D_rep_1"] == 3.0
    assert system.parameters["D_rep_2"] == 2.0
    assert system.parameters["Omega"] == 1.15
    assert system.parameters["D_att_1"] == 0.025


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("D_att_1", -0.1, "D_att_1 = -0.1: must be >= 0"),
        ("D_rep_2", -1.0, "D_rep_2 = -1.0: must be >= 0"),
        ("D_rep", -1.0, "D_rep_1 = -1.0: must be >= 0"),
        ("H", -1e-19, "H = -1e-19: must be >= 0"),
        ("E_star", -1.0, "E_star = -1.0: must be >= 0"),
        ("Omega", 0.0, "Omega = 0.0: must be > 0"),
        ("eta", 0.0, "eta = 0.0: must be > 0"),
        ("a0", -2e-10, "a0 = -2e-10: must be > 0"),
        ("R", 0.0, "R = 0.0: must be > 0"),
        ("ybar", float("nan"), "ybar = nan: must be a finite number"),
    ],
)
def test_parameter_outside_its_bounds_is_refused(systems, name, value, message):
    for attempt in (systems[2].resolve, lambda values: tapping_mode(table1(), 2, parameters=values)):
        with pytest.raises(InputError) as error:
            attempt({name: value})
        assert str(error.value) == message


def test_damping_and_attraction_may_be_zero(systems):
    values = systems[2].resolve({"D_att": 0.0, "D_rep": 0.0, "H": 0.0, "E_star": 0.0})
    assert values["D_rep_2"] == 0.0


def test_unknown_parameter_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match=r"^parameter = 'D_atk': must be one of .*; did you mean 'D_att'\?$"):
        tapping_mode(table1(), parameters={"D_atk": 0.1})


def test_flight_is_defined_above_the_sample_and_contact_everywhere(systems):
    assert systems[2].modes["flight"].domain == systems[2].outputs["z"]["flight"]
    assert systems[2].modes["contact"].domain is None


@pytest.mark.parametrize("modes", [0, -2, 1.5, True, None], ids=repr)
def test_count_of_modes_that_is_none_is_refused(modes):
    with pytest.raises(InputError) as error:
        tapping_mode(table1(), modes)
    assert str(error.value) == f"modes = {modes!r}: must be an integer between 1 and 100"


@pytest.mark.parametrize(
    ("static_term", "hint"),
    [("as printed", "; did you mean 'as-printed'?"), (None, ""), (["consistent"], "")],
)
def test_static_term_of_another_name_is_refused(static_term, hint):
    with pytest.raises(InputError) as error:
        tapping_mode(table1(), static_term=static_term)
    assert str(error.value) == f"static_term = {static_term!r}: must be one of consistent, as-printed{hint}"


def test_setup_of_another_kind_is_refused():
    with pytest.raises(InputError) as error:
        tapping_mode("table1")
    assert str(error.value) == "setup = 'table1': must be a Setup; table1() returns the paper's"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cantilever": 1}, "cantilever = 1: must be a Cantilever"),
        ({"sample": None}, "sample = None: must be a DMTSample"),
        ({"eta": -6e-8}, "eta = -6e-08: must be a finite number > 0 (in m)"),
        ({"eta": float("nan")}, "eta = nan: must be a finite number > 0 (in m)"),
        ({"eta": 2e-10}, "eta = 2e-10: must be larger than a0 = 2e-10, where contact begins (in m)"),
    ],
)
def test_setup_that_cannot_be_is_refused(change, message):
    setup = table1()
    with pytest.raises(InputError) as error:
        Setup(**{"cantilever": setup.cantilever, "sample": setup.sample, "eta": setup.eta} | change)
    assert str(error.value) == message


HEAVY = "[name for name in ('sympy', 'numba', 'scipy', 'xarray', 'matplotlib') if name in sys.modules]"


def in_new_process(code):
    """Output of `code` in a Python of its own."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def test_table_1_is_light_to_import():
    assert in_new_process(f"import sys; from saltus import afm; afm.table1(); print({HEAVY})") == "[]"


def test_system_seen_before_needs_no_sympy(systems):
    code = f"import sys; from saltus import afm; s = afm.tapping_mode(afm.table1(), 2); print(s.states[0], {HEAVY})"
    assert in_new_process(code) == "q1 []"


@pytest.mark.campaign
def test_model_seen_before_needs_no_sympy():
    code = (
        f"import sys; from saltus import afm; p = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0); "
        f"s = afm.model(p, afm.Hydration(F_nN=1.0, l_nm=0.5), afm.Drive(10.0), Zc_nm=9.0); print(s.states[0], {HEAVY})"
    )
    in_new_process(code)
    assert in_new_process(code) == "z1_nm []"


@pytest.mark.campaign
def test_names_of_the_floor_load_in_any_order():
    told = "print({callable(getattr(afm, n)) for n in afm.__all__})"
    code = f"import saltus.afm.paper.table1; from saltus import afm; {told}"
    assert in_new_process(code) == "{True}"


def test_name_that_the_floor_lacks_is_an_attribute_error():
    from saltus import afm

    with pytest.raises(AttributeError, match=r"^No saltus.afm attribute Lever$"):
        afm.Lever  # noqa: B018
    assert set(afm.__all__) <= set(dir(afm))
