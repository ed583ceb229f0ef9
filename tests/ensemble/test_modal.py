"""The linear part of a mode's field: against the definition's own field, matrix exponentials and bounds by samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

import systems
from saltus.ensemble.modal import linear_parts
from saltus.system.hybrid import HybridSystem, Mode, Transition

W = 1.3
PERIOD = 2.0 * math.pi / W


def driven(field, transitions=(), parameters=None):
    """A system of one mode 'm', driven at the speed W."""
    return HybridSystem(
        tuple(field), {"w": W, "A": 0.7} | (parameters or {}), {"m": Mode(field)}, transitions, phase=("s", "w")
    )


def part_of(system, mode=0, parameters=None):
    p = system.parameter_vector(parameters or {})
    rate = float(system.compiled.field(0, system.full_state(np.zeros(len(system.states))), p)[-1])
    return linear_parts(system, p, rate, 2.0 * math.pi / rate).get(mode), p


def response(part, theta):
    angles = np.array(part.harmonics) * theta
    return part.constant + np.cos(angles) @ part.cosines + np.sin(angles) @ part.sines


def modal(part, numbers, x, theta):
    """Modal coordinates, by the numbers that the generated text reads."""
    return np.array([row_value(part, numbers, f"z{i}", x, theta) for i in range(part.n)])


def row_value(part, numbers, key, slots, theta):
    value = numbers[f"{key}_constant"] + sum(numbers[f"{key}_{i}"] * slots[i] for i in range(part.n))
    for j in part.harmonics:
        value += numbers[f"{key}_c{j}"] * math.cos(j * theta) + numbers[f"{key}_s{j}"] * math.sin(j * theta)
    return value


@pytest.fixture(scope="module")
def coupled():
    """Two oscillators, a state that decays and all kinds of forcing; an event that the forcing moves."""
    field = {
        "x": "v",
        "v": "-2*x - 0.1*v + 0.3*y + A*cos(s) + 0.2*sin(3*s) + 0.4",
        "y": "u",
        "u": "-5*y - 0.2*u + 0.1*x - 0.3*sin(s)",
        "r": "-0.5*r + x",
    }
    return driven(field, [Transition("m", "m", "x + 2*y - 3 - 0.1*sin(s)", 1, {"v": "-v"})])


def test_the_response_to_the_forcing_is_a_motion(coupled):
    part, p = part_of(coupled)
    assert part.harmonics == (1, 3)
    for theta in np.linspace(0.0, 6.0, 13):
        angles = np.array(part.harmonics) * theta
        speeds = np.array(part.harmonics) * W
        rate = -(speeds * np.sin(angles)) @ part.cosines + (speeds * np.cos(angles)) @ part.sines
        field = coupled.compiled.field(0, np.append(response(part, theta), theta), p)
        np.testing.assert_allclose(field[:-1], rate, atol=1e-13)


def test_deviations_from_the_response_obey_the_matrix(coupled):
    part, p = part_of(coupled)
    generator = np.random.default_rng(1)
    for theta in np.linspace(0.0, 6.0, 7):
        x, y = generator.normal(size=(2, 5))
        fields = [coupled.compiled.field(0, np.append(state, theta), p)[:-1] for state in (x, y)]
        np.testing.assert_allclose(fields[0] - fields[1], part.matrix @ (x - y), atol=1e-13)


def test_the_basis_is_of_eigenvectors_in_pairs(coupled):
    part, _ = part_of(coupled)
    np.testing.assert_allclose(part.matrix @ part.basis, part.basis * part.eigenvalues, atol=1e-13)
    assert part.pairs == 2
    assert (part.eigenvalues[[0, 2]].imag > 0.0).all()
    np.testing.assert_array_equal(part.eigenvalues[[1, 3]], part.eigenvalues[[0, 2]].conj())
    assert part.eigenvalues[4] == -0.5


def test_modal_coordinates_give_the_state_back(coupled):
    part, _ = part_of(coupled)
    numbers = part.numbers(np.ones(5))
    generator = np.random.default_rng(2)
    for theta in np.linspace(0.0, 6.0, 7):
        x = generator.normal(size=5)
        z = modal(part, numbers, x, theta)
        found = [row_value(part, numbers, f"x{e}", z, theta) for e in range(5)]
        np.testing.assert_allclose(found, x, atol=1e-12)


def turned(part, numbers, z, t):
    """Modal coordinates after a time."""
    out = np.empty(part.n)
    for i in range(part.pairs):
        value = complex(z[2 * i], z[2 * i + 1]) * np.exp(complex(numbers[f"lr{i}"], numbers[f"li{i}"]) * t)
        out[2 * i : 2 * i + 2] = value.real, value.imag
    for i in range(2 * part.pairs, part.n):
        out[i] = z[i] * math.exp(numbers[f"lr{i}"] * t)
    return out


def test_modal_coordinates_turn_as_the_matrix_exponential_does(coupled):
    part, _ = part_of(coupled)
    numbers = part.numbers(np.ones(5))
    x, theta = np.random.default_rng(3).normal(size=5), 0.4
    z = modal(part, numbers, x, theta)
    for t in (0.01, 0.3, 2.0, 20.0):
        later = theta + W * t
        wanted = response(part, later) + expm(part.matrix * t) @ (x - response(part, theta))
        after = turned(part, numbers, z, t)
        found = [row_value(part, numbers, f"x{e}", after, later) for e in range(5)]
        np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_an_event_function_and_its_rate_are_those_of_the_definition(coupled):
    part, p = part_of(coupled)
    numbers = part.numbers(np.ones(5))
    generator = np.random.default_rng(4)
    for theta in np.linspace(0.0, 6.0, 7):
        x = generator.normal(size=5)
        z = modal(part, numbers, x, theta)
        assert row_value(part, numbers, "h0", z, theta) == pytest.approx(
            x[0] + 2.0 * x[2] - 3.0 - 0.1 * math.sin(theta), abs=1e-12
        )
        field = coupled.compiled.field(0, np.append(x, theta), p)
        rate = field[0] + 2.0 * field[2] - 0.1 * W * math.cos(theta)
        assert row_value(part, numbers, "d0", z, theta) == pytest.approx(rate, abs=1e-12)


def test_no_event_function_bends_more_than_its_bound(coupled):
    part, _ = part_of(coupled)
    numbers = part.numbers(np.ones(5))
    generator = np.random.default_rng(5)
    nearest = 0.0
    for _ in range(200):
        theta = generator.uniform(0.0, 6.0)
        z = generator.normal(size=5) * 10.0 ** generator.uniform(-2.0, 2.0, 5)
        sizes = [*np.hypot(z[0:4:2], z[1:4:2]), abs(z[4])]
        bound = numbers["m0"] + sum(numbers[f"m0_{i}"] * size for i, size in enumerate(sizes))
        for t in np.linspace(0.0, numbers["longest"], 9):
            slopes = [
                row_value(part, numbers, "d0", turned(part, numbers, z, t + e), theta + W * (t + e))
                for e in (-1e-5, 1e-5)
            ]
            bend = abs(slopes[1] - slopes[0]) / 2e-5
            assert bend <= bound * (1.0 + 1e-6)
            nearest = max(nearest, bend / bound)
    assert nearest > 0.3  # a bound, and not a needless one


def test_bounds_hold_where_motions_grow():
    field = {"x": "v", "v": "-x + 2*v + A*cos(s) - 0.75*x"}
    part, _ = part_of(driven(field, [Transition("m", "m", "x - 1", 1, {"v": "-v"})]))
    assert part.eigenvalues.real.max() > 0.5
    numbers = part.numbers(np.ones(2))
    z = np.array([1.0, -0.7])
    bound = numbers["m0"] + numbers["m0_0"] * np.hypot(*z)
    for t in np.linspace(0.0, numbers["longest"], 30):
        slopes = [row_value(part, numbers, "d0", turned(part, numbers, z, t + e), W * (t + e)) for e in (-1e-5, 1e-5)]
        assert abs(slopes[1] - slopes[0]) / 2e-5 <= bound


def test_every_mode_with_a_linear_part_has_its_own():
    system = systems.afm(2)
    p = system.parameter_vector({"Omega": 1.15})
    parts = linear_parts(system, p, 1.15, 2.0 * math.pi / 1.15)
    assert 0 in parts
    flight = parts[0]
    frequencies = np.sqrt(np.array(systems.K) - 0.0125**2)
    np.testing.assert_allclose(np.sort(flight.eigenvalues[[0, 2]].imag), frequencies, rtol=1e-12)
    np.testing.assert_allclose(flight.eigenvalues.real, -0.0125, rtol=1e-9)
    assert flight.rest == (2, 3)


@pytest.mark.parametrize(
    "field",
    [
        {"x": "v", "v": "-x + A*cos(s)/(2 + cos(s))"},
        {"x": "A*x*cos(s)"},
    ],
    ids=["a pulse of the phase", "no matrix"],
)
def test_a_field_that_does_not_split_has_no_linear_part(field):
    part, _ = part_of(driven(field))
    assert part is None


@pytest.mark.parametrize(
    "field",
    [
        {"x": "y", "y": "-x - 2*y + A*cos(s)"},
        {"x": "v", "v": "-w**2*x + A*cos(s)"},
        {"x": "-x + A*cos(s)", "y": "1"},
    ],
    ids=["one eigenvector for two eigenvalues", "driven at its own frequency", "a state that only runs on"],
)
def test_a_linear_field_without_modes_or_response_has_no_linear_part(field):
    part, _ = part_of(driven(field))
    assert part is None
