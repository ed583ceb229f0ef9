"""Attractors and basins of maps against closed forms, symmetries and plain loops."""

from __future__ import annotations

import pickle
import signal

import numpy as np
import pytest
from scipy.stats import qmc

import saltus
from discrete import HENON, LOGISTIC, NEWTON, TENT
from saltus import InputError, Map, Piece, find_attractors, map_basins
from saltus.basins.attractors.found import AttractorOptions
from saltus.basins.map.labelling import Labelling
from saltus.basins.measures.integrity import global_integrity, integrity_factor
from saltus.ensemble.map_ensemble import MapEnsemble
from saltus.ensemble.traps import DIVERGED, UNDECIDED
from saltus.errors import DefinitionError
from saltus.options import BasinOptions
from wells import Interrupt

SQUARE = {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}

# continuous, with slope 2 between -1 and 1 and fixed points at -3, 0 and 3
BISTABLE = Map(
    ("x",),
    {},
    pieces={
        "low": Piece({"x": "(x - 3)/2"}, where="-1 - x"),
        "middle": Piece({"x": "2*x"}, where=("x + 1", "1 - x")),
        "high": Piece({"x": "(x + 3)/2"}, where="x - 1"),
    },
    name="bistable map",
)


@pytest.fixture(scope="module")
def henon():
    return find_attractors(HENON, {}, SQUARE)


@pytest.fixture(scope="module")
def roots():
    return find_attractors(NEWTON, {}, SQUARE)


@pytest.mark.campaign
def test_the_henon_map_has_one_chaotic_attractor(henon):
    assert henon.kinds == {"chaotic": "chaotic"}
    assert henon.fates["undecided"] == 0
    assert 0 < henon.fates["diverged"] < 256
    assert dict(henon.orbits) == {}
    assert "Attractors of Henon map" in repr(henon)


@pytest.mark.campaign
def test_the_basin_of_the_henon_map_is_that_of_a_plain_loop_cell_by_cell(henon):
    basins = map_basins(HENON, {}, {"x": (-2, 2, 300), "y": (-2, 2, 300)}, henon)
    x, y = np.meshgrid(*basins.grid.axes, indexing="ij")
    with np.errstate(all="ignore"):
        for _ in range(300):
            x, y = 1.0 - 1.4 * x * x + y, 0.3 * x
    bounded = (np.abs(x) < 1e3) & (np.abs(y) < 1e3)
    assert np.array_equal(basins.labels == 0, bounded)
    assert np.array_equal(basins.labels == DIVERGED, ~bounded)


def test_newtons_method_has_three_roots_and_basins_of_threefold_symmetry(roots):
    third = 2.0 * np.pi / 3.0
    assert len(roots.names) == 3
    assert set(roots.kinds.values()) == {"period-1"}
    angles = [float(np.arctan2(*roots.points[name][0, ::-1])) for name in roots.names]
    assert sorted(angles) == pytest.approx([-third, 0.0, third], abs=1e-12)
    assert max(roots.decays.values()) < 1e-6  # Newton's method converges quadratically
    basins = map_basins(NEWTON, {}, {"x": (-2, 2, 20), "y": (-2, 2, 20)}, roots)
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (20_000, 2))
    turn = np.array([[np.cos(third), -np.sin(third)], [np.sin(third), np.cos(third)]])
    after = {
        k: int(np.argmin([abs(np.angle(np.exp(1j * (b - a - third)))) for b in angles])) for k, a in enumerate(angles)
    }
    first, second = basins.classify(points), basins.classify(points @ turn.T)
    # rounding tells next to the border alone
    assert np.mean([after.get(int(a), -1) != int(b) for a, b in zip(first, second, strict=True)]) < 1e-3


def test_newtons_basins_are_those_of_complex_arithmetic(roots):
    basins = map_basins(NEWTON, {}, {"x": (-2, 2, 200), "y": (-2, 2, 200)}, roots)
    x, y = np.meshgrid(*basins.grid.axes, indexing="ij")
    z = x + 1j * y
    for _ in range(100):
        z = (2.0 * z + 1.0 / z**2) / 3.0
    at = np.array([complex(*roots.points[name][0]) for name in roots.names])
    nearest = np.abs(z[..., None] - at).argmin(axis=-1)
    assert np.mean(nearest != basins.labels) < 1e-3


def test_two_attractors_of_a_piecewise_linear_map_have_the_exact_border():
    found = find_attractors(BISTABLE, {}, {"x": (-5.0, 5.0)})
    assert [found.points[name][0, 0] for name in found.names] == pytest.approx([-3.0, 3.0], abs=1e-12)
    assert list(found.decays.values()) == pytest.approx([0.5, 0.5])
    basins = map_basins(BISTABLE, {}, {"x": (-5, 5, 1000)}, found)
    (x,) = basins.grid.axes
    assert np.array_equal(basins.labels, (x > 0.0).astype(np.uint8))
    edge = np.array([[-1e-12], [1e-12], [-1e-300], [1e-300], [0.0]])
    # from 1e-300 the way out takes a thousand iterations, from 0 for ever
    assert basins.classify(edge).tolist() == [0, 1, UNDECIDED, UNDECIDED, UNDECIDED]
    patient = map_basins(BISTABLE, {}, {"x": (-5, 5, 10)}, found, options=BasinOptions(longest=2000))
    assert patient.classify(edge).tolist() == [0, 1, 0, 1, UNDECIDED]


def test_a_border_that_is_no_axis_is_exact():
    # in u = x + y the map above, in y a contraction: the border is the line x + y = 0
    u = "(x + y)"
    parts = {
        "low": Piece({"x": f"({u} - 3)/2 - y/4", "y": "y/4"}, where=f"-1 - {u}"),
        "middle": Piece({"x": f"2*{u} - y/4", "y": "y/4"}, where=(f"{u} + 1", f"1 - {u}")),
        "high": Piece({"x": f"({u} + 3)/2 - y/4", "y": "y/4"}, where=f"{u} - 1"),
    }
    slanted = Map(("x", "y"), {}, pieces=parts)
    basins = map_basins(slanted, {}, {"x": (-4, 4, 150), "y": (-4, 4, 151)})
    x, y = np.meshgrid(*basins.grid.axes, indexing="ij")
    clear = np.abs(x + y) > 1e-9
    assert np.array_equal(basins.labels[clear], (x + y > 0.0)[clear].astype(np.uint8))
    assert clear.mean() > 0.99


@pytest.mark.campaign
@pytest.mark.parametrize("slope", [1.5, 1.8, 1.99])
def test_the_basin_of_the_tent_map_is_the_unit_interval(slope):
    basins = map_basins(TENT, {"a": slope}, {"x": (-0.5, 1.5, 2000)})
    (x,) = basins.grid.axes
    assert basins.attractors.names == ("chaotic",)
    assert np.array_equal(basins.labels == 0, (x > 0.0) & (x < 1.0))
    assert np.array_equal(basins.labels == DIVERGED, (x < 0.0) | (x > 1.0))


@pytest.mark.parametrize(("r", "period"), [(2.8, 1), (3.2, 2), (3.5, 4), (3.55, 8), (3.83, 3), (3.7389, 5)])
def test_cycles_of_the_logistic_map_are_found_with_their_multipliers(r, period):
    found = find_attractors(LOGISTIC, {"r": r}, {"x": (0.01, 0.99)}, options=AttractorOptions(samples=500))
    assert found.names == (f"period-{period}",)
    (points,), (decay,) = found.points.values(), found.decays.values()
    images = r * points * (1.0 - points)
    np.testing.assert_allclose(np.roll(points, -1, axis=0), images, atol=1e-13)
    assert decay == pytest.approx(float(np.abs(np.prod(r * (1.0 - 2.0 * points)))) ** (1.0 / period), abs=1e-9)


@pytest.mark.campaign
def test_a_cycle_longer_than_sixteen_is_found():
    # between the doublings at 3.56876 and 3.56969
    found = find_attractors(LOGISTIC, {"r": 3.5692}, {"x": (0.01, 0.99)}, options=AttractorOptions(samples=500))
    assert found.names == ("period-32",)


def test_attractors_that_two_pieces_share_name_both():
    found = find_attractors(TENT, {"a": 0.9}, {"x": (0.1, 0.9)}, options=AttractorOptions(samples=500))
    assert found.names == ("period-1",)
    assert abs(found.points["period-1"][0, 0]) < 1e-12


@pytest.mark.campaign
@pytest.mark.parametrize(("left", "right"), [(-0.5, 0.3), (-0.5, -1.9), (0.9, 0.9)])
def test_a_fixed_point_on_a_border_attracts(left, right):
    kink = Map(("x",), {"a": left, "b": right}, pieces={"l": Piece({"x": "a*x"}, "-x"), "r": Piece({"x": "b*x"}, "x")})
    basins = map_basins(kink, {}, {"x": (-1, 1, 100)}, {"options": AttractorOptions(samples=500)})
    assert basins.attractors.names == ("period-1",)
    assert abs(basins.attractors.points["period-1"]).max() < 1e-12
    assert basins.fractions()["period-1"] == 1.0


@pytest.mark.campaign
def test_integrity_of_a_map_follows_its_basin_along_a_parameter(tmp_path):
    profile = saltus.erosion_profile(TENT, "a", [1.5, 1.9], {"x": (-0.5, 1.5, 400)})
    assert profile.attractors == ("chaotic",)
    assert saltus.load(profile.save(tmp_path / "profile.nc")) == profile


def test_a_map_that_keeps_areas_has_no_attractor():
    standard = Map(("x", "y"), {"k": 0.3}, {"x": "x + y + k*sin(x)", "y": "y + k*sin(x)"})
    with pytest.raises(InputError, match="one with attractors: along .* volumes change by less than 1 %"):
        find_attractors(standard, {}, SQUARE)


@pytest.mark.campaign
def test_a_closed_curve_is_a_quasi_periodic_attractor():
    delayed = Map(("x", "y"), {"r": 2.05}, {"x": "r*x*(1 - y)", "y": "x"})
    found = find_attractors(delayed, {}, {"x": (0.3, 0.7), "y": (0.3, 0.7)})
    assert "quasi-periodic" in found.kinds.values()


@pytest.mark.campaign
def test_basins_of_a_map_in_billionths_are_the_same(henon):
    unit = 1e-9
    small = Map(("x", "y"), {"a": 1.4, "b": 0.3}, {"x": "1e-9 - a*1e9*x**2 + y", "y": "b*x"})
    region = {name: (low * unit, high * unit) for name, (low, high) in SQUARE.items()}
    found = find_attractors(small, {}, region)
    assert found.kinds == henon.kinds
    one = map_basins(HENON, {}, {"x": (-2, 2, 150), "y": (-2, 2, 150)}, henon)
    other = map_basins(small, {}, {"x": (-2 * unit, 2 * unit, 150), "y": (-2 * unit, 2 * unit, 150)}, found)
    assert np.mean(one.labels != other.labels) < 1e-4


@pytest.mark.campaign
def test_an_interrupt_waits_until_the_sequence_of_starts_is_made(monkeypatch):
    made = []

    class Slow(qmc.Sobol):
        def __init__(self, *given, **named):
            signal.raise_signal(signal.SIGINT)
            super().__init__(*given, **named)
            made.append(self)

    monkeypatch.setattr(qmc, "Sobol", Slow)
    with pytest.raises(KeyboardInterrupt):
        find_attractors(HENON, {}, SQUARE)
    assert len(made) == 1


@pytest.mark.campaign
def test_files_and_stores_hold_basins_of_maps(henon, roots, tmp_path, monkeypatch):
    monkeypatch.setattr(saltus.basins.map.grid, "_LEAST", 60)
    monkeypatch.setattr(saltus.basins.map.grid, "_CHUNK", 30)
    assert saltus.load(henon.save(tmp_path / "henon.nc")) == henon
    assert pickle.loads(pickle.dumps(roots)) == roots
    grid, path = {"x": (-2, 2, 40), "y": (-2, 2, 40)}, tmp_path / "roots.zarr"
    whole = map_basins(NEWTON, {}, grid, roots)
    part = map_basins(NEWTON, {}, grid, roots, path=path, progress=Interrupt(3))
    assert part.stopped.startswith("interrupted: ")
    stored = map_basins(NEWTON, {}, grid, roots, path=path)
    assert np.array_equal(np.asarray(stored.labels), whole.labels)
    again = saltus.load(path)
    assert again == stored
    assert again.noted_error is not None
    assert again.noted_error.wrong == 0
    assert saltus.load(whole.save(tmp_path / "whole.nc")) == whole


def test_labels_follow_from_plain_data_alone(roots):
    basins = map_basins(NEWTON, {}, {"x": (-2, 2, 10), "y": (-2, 2, 10)}, roots)
    again = Labelling.from_definition(basins.inputs)
    points = np.random.default_rng(0).uniform(-2, 2, (500, 2))
    assert np.array_equal(again.of(points), basins.classify(points))


def test_measures_take_basins_of_maps(roots):
    basins = map_basins(NEWTON, {}, {"x": (-2, 2, 60), "y": (-2, 2, 60)}, roots)
    error = basins.label_error(300, by_events=10)
    assert (error.wrong, error.wrong_by_events, error.cells_by_events) == (0, 0, 10)
    name = roots.names[-1]
    assert global_integrity(basins, name).share == pytest.approx(basins.fractions()[name])
    assert integrity_factor(basins, name).value > 0.3


@pytest.mark.campaign
def test_threads_do_not_change_labels(henon):
    points = np.random.default_rng(0).uniform(-2, 2, (20_000, 2))
    one, two = (MapEnsemble(HENON, {}, threads=count).settle(points, henon.traps, 200) for count in (1, 2))
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))
    alone = [MapEnsemble(HENON, {}).alone(x, henon.traps, 200) for x in points[:20]]
    assert alone == one[0][:20].tolist()


def test_a_gap_ends_a_map_of_basins_with_its_state():
    opened = Map(("x",), {"d": 0.0}, pieces={"low": Piece({"x": "x/2"}, "-x"), "high": Piece({"x": "x/2"}, "x - d")})
    with pytest.raises(DefinitionError, match="none of 'low', 'high' does"):
        find_attractors(opened, {"d": 0.1}, {"x": (-1, 1)})
    with pytest.raises(DefinitionError, match="'low', 'high' do at once"):
        MapEnsemble(opened, {"d": -0.1}).strobe([[-1.0], [-0.05]])


def test_starts_that_are_no_numbers_diverge():
    ensemble = MapEnsemble(HENON, {})
    found = ensemble.strobe([[np.nan, 0.0], [0.1, 0.1], [np.inf, 0.0], [50.0, 50.0]], count=10)[0]
    assert np.isnan(found).any(axis=1).tolist() == [True, False, True, True]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: find_attractors(HENON, {}, SQUARE, options=AttractorOptions(interval=1.0)),
            "interval = 1.0: must be left out for a map",
        ),
        (lambda: map_basins(HENON, {}, {"x": (-1, 1, 5), "y": 0.0}, options=BasinOptions(engine="cuda")), "for a map"),
        (lambda: map_basins(3, {}, {"x": (-1, 1, 5)}), "system = 3: must be a HybridSystem"),
        (lambda: find_attractors(HENON, {}, {"x": (-1, 1)}), "'y' is missing"),
    ],
)
def test_wrong_arguments_are_told(call, message):
    with pytest.raises(InputError, match=message):
        call()
