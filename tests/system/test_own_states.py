"""Modes with states of their own: motions, orbits, multipliers, files, and what is refused."""

import math

import numpy as np
import pytest

import saltus
from own_states import belt, wall
from saltus import Mode, Transition
from saltus.errors import DefinitionError, InputError
from saltus.flow.saltation import saltation_matrix


@pytest.mark.filterwarnings("ignore:saltus. 'release' lands beyond")
@pytest.mark.parametrize(
    ("w", "velocity", "phase", "contact", "flight", "released", "multipliers"),
    [
        (1.2, 2.5064148550713, 0.0091347053263, 0.7577372022708, 4.4782505537122,
         (0.736801431575, -1.379116323905), (0.08636009 + 0.4148128j, 0.08636009 - 0.4148128j)),
        (0.9, 1.8075016589416, 5.942940943161, 0.7867322639642, 6.1945847440131,
         (0.667947220994, -0.939151561446), (-0.52436183, -0.26981842)),
    ],
)  # fmt: skip
def test_a_wall_with_a_state_of_its_own_gives_the_orbit_of_matrix_exponentials(
    w, velocity, phase, contact, flight, released, multipliers
):
    orbit = saltus.find_orbit(wall(), {"w": w}, [0.0, 0.0], mode="free")
    parts = {part.mode: part for part in orbit.segments}
    assert parts["contact"].duration == pytest.approx(contact, abs=1e-11)
    assert parts["free"].duration == pytest.approx(flight, abs=1e-11)
    np.testing.assert_allclose(parts["contact"].state[:3], [0.5, velocity, 0.0], atol=1e-11)
    assert parts["contact"].state[3] % (2.0 * math.pi) == pytest.approx(phase, abs=1e-10)
    np.testing.assert_allclose(parts["free"].state[:2], released, atol=1e-11)
    # one for each state of the system: that of a state which the first mode lacks is 0
    np.testing.assert_allclose(orbit.multipliers, [*multipliers, 0.0], atol=6e-9)


@pytest.mark.filterwarnings("ignore:saltus. 'release' lands beyond")
def test_a_state_that_a_mode_lacks_is_no_number_where_it_is_seen():
    orbit = saltus.find_orbit(wall(), {}, [0.0, 0.0], mode="free")
    seen = orbit.sample(20_000)
    free = seen["mode"].values == 0
    assert np.all(np.isnan(seen["q"].values[free]))
    assert np.all(np.isfinite(seen["q"].values[~free]))
    motion = saltus.simulate(wall(), {}, [0.0, 0.0], mode="free", t_end=10.0)
    q = motion(np.linspace(0.0, 10.0, 200))[:, 2]
    assert np.all(np.isnan(q) == (motion.mode_at(np.linspace(0.0, 10.0, 200)) == "free"))
    inside = seen["q"].values[~free]
    assert orbit.min["q"] == pytest.approx(inside.min(), abs=1e-6)
    assert orbit.max["q"] == pytest.approx(inside.max(), abs=1e-4)


@pytest.mark.filterwarnings("ignore:saltus. 'release' lands beyond")
def test_the_work_on_the_wall_is_what_it_dissipates_and_loses():
    orbit = saltus.find_orbit(wall(), {}, [0.0, 0.0], mode="free")
    contact = next(part for part in orbit.segments if part.mode == "contact")
    motion = saltus.simulate(
        wall(), {}, contact.state, mode="contact", t_end=contact.duration, tolerance=1e-13,
    )  # fmt: skip
    t = contact.duration * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 4001)))[:-1]
    x, v, q, _ = motion(t).T
    u = x - 0.5
    work = np.trapezoid((10.0 * u + 20.0 * (u - q)) * v, t)
    dissipated = np.trapezoid(20.0 * 0.1 * ((u - q) / 0.1) ** 2, t)
    stored = 0.5 * (10.0 * u[-1] ** 2 + 20.0 * (u[-1] - q[-1]) ** 2)
    assert work == pytest.approx(2.214956937469, rel=1e-5)
    assert dissipated == pytest.approx(1.794395052501, rel=1e-5)
    assert stored == pytest.approx(0.420561884968, rel=1e-3)


def test_multipliers_other_than_0_do_not_depend_on_where_an_orbit_starts():
    orbit = saltus.find_orbit(belt(), {}, [0.0], mode="stick")
    jump = 0.5
    assert orbit.period == pytest.approx(2 * math.pi - 2 * math.atan(jump / 0.2) + 2 * jump / 0.2, abs=1e-12)
    np.testing.assert_allclose(np.abs(orbit.multipliers), [0.0, 1.0], atol=1e-12)
    parts = orbit.segments
    turned = [parts[1], parts[0]] if parts[0].mode == "stick" else list(parts)
    given = [(p.mode, p.transition, p.state[:1] if p.mode == "stick" else p.state, p.duration) for p in turned]
    again = saltus.solve_orbit(belt(), {}, segments=given)
    np.testing.assert_allclose(np.abs(again.multipliers), [0.0, 1.0], atol=1e-12)


@pytest.mark.filterwarnings("ignore:saltus. 'release' lands beyond")
def test_branches_exponents_sweeps_and_files_go_through(tmp_path):
    orbit = saltus.find_orbit(wall(), {}, [0.0, 0.0], mode="free")
    branch = saltus.continue_orbit(orbit, "w", (1.15, 1.25))
    assert all(reason.endswith("bound reached") for reason in branch.stopped)
    branch.save(tmp_path / "branch.nc")
    assert saltus.load(tmp_path / "branch.nc").system.modes["free"].states == ("x", "v")
    exponents = saltus.lyapunov_spectrum(
        wall(), {}, [0.0, 0.0, 0.0], mode="free", average=saltus.Average(periods=60, discard=40)
    ).exponents
    expected = np.log(np.abs(orbit.multipliers[:2])) / orbit.period
    np.testing.assert_allclose(exponents[:2], expected, atol=2e-2)
    assert exponents[2] == -np.inf
    swept = saltus.run_sweep(wall(), "w", [1.2], x0=[0.0, 0.0, 0.0])
    assert "period-1" in repr(swept)


def test_saltation_matrices_are_rectangular():
    assert saltation_matrix(wall(), None, "touch", [0.5, 1.0]).shape == (4, 3)
    assert saltation_matrix(wall(), None, "release", [0.7, -1.0, 0.3]).shape == (3, 4)
    np.testing.assert_array_equal(saltation_matrix(wall(), None, "touch", [0.5, 1.0])[[0, 1, 3]], np.eye(3))


def test_what_a_mode_lacks_is_told():
    with pytest.raises(DefinitionError, match="a reset with 'q'"):
        wall(v="v")
    fields = {"a": Mode({"x": "1"}, states=("x",)), "b": Mode({"x": "1", "q": "2"})}
    crossing = Transition("a", "b", "x", 1, {"q": "0"})
    for parts, words in (
        ({"a": Mode({"x": "q"}, states=("x",))}, "an expression without q"),
        ({"a": Mode({"x": "1"}, states=("z",))}, "states of the system"),
        ({"a": Mode({"x": "1", "q": "1"}, states=("x",))}, "one of its states"),
    ):
        with pytest.raises(DefinitionError, match=words):
            saltus.HybridSystem(("x", "q"), {}, {**fields, **parts}, [crossing])
    with pytest.raises(DefinitionError, match="an expression without q"):
        saltus.HybridSystem(("x", "q"), {}, fields, [Transition("a", "b", "x - q", 1, {"q": "0"})])
    with pytest.raises(DefinitionError, match="a state of 'a'"):
        saltus.HybridSystem(("x", "q"), {}, fields, [Transition("b", "a", "x", 1, {"q": "1"})])
    system = saltus.HybridSystem(("x", "q"), {}, fields, [crossing])
    with pytest.raises(InputError, match="it lacks q"):
        saltus.simulate(system, {}, [0.0, 1.0], mode="a", t_end=1.0)


def test_an_orbit_that_visits_no_mode_with_a_state_is_isolated():
    orbit = saltus.find_orbit(wall(), {"A": 0.13}, [0.0, 0.0], mode="free")
    assert orbit.signature == (("free", "theta"),)
    size = math.exp(-0.1 * math.pi / 1.2)
    np.testing.assert_allclose(np.abs(orbit.multipliers), [size, size, 0.0], atol=1e-12)
