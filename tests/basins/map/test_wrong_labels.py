"""The error of labels counts motions that end on attractors that the search has missed, and tells these."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

from saltus import HybridSystem, InputError, Map, Mode, Piece, Transition, find_attractors, load, map_basins
from saltus.basins.map.wrong_labels import LabelError, label_error_of
from saltus.options import AttractorOptions, BasinOptions
from selection import guarding

FEW = AttractorOptions(starts=16, samples=200)


def with_window(place, width, rate, own, unit=1.0):
    """x -> rate x, but for a window of a width whose motions stay in it and end in its middle."""
    low, high = place * unit, (place + width) * unit
    middle = 0.5 * (low + high)
    inside = Piece({"x": f"{own!r}*(x - {middle!r}) + {middle!r}"}, where=(f"x - {low!r}", f"{high!r} - x"))
    left, right = Piece({"x": f"{rate!r}*x"}, where=f"{low!r} - x"), Piece({"x": f"{rate!r}*x"}, where=f"x - {high!r}")
    return Map(("x",), {}, pieces={"left": left, "window": inside, "right": right}), middle


def mapped(system, axis, found, **options):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        basins = map_basins(system, {}, {"x": axis}, found, options=BasinOptions(**options))
    return basins, [str(each.message) for each in told]


@pytest.fixture(scope="module")
def missed():
    system, middle = with_window(0.3, 1e-5, 0.5, 0.5)
    found = find_attractors(system, {}, {"x": (-1, 1)}, options=FEW)
    assert found.names == ("period-1",)
    return system, middle, found


def test_a_grid_on_a_missed_attractor_alone_has_wrong_labels_only(missed):
    system, middle, found = missed
    basins, told = mapped(system, (0.3 + 1e-6, 0.3 + 9e-6, 300), found)
    assert basins.fractions()["period-1"] == 1.0
    error = basins.label_error(200)
    assert (error.wrong, error.cells, error.nowhere, error.untold) == (200, 200, 200, 0)
    assert error.missed == f"period-1 through [{middle:.9g}]"
    assert (basins.noted_error.wrong, basins.noted_error.cells) == (100, 100)
    assert len(told) == 1
    assert f"missed by the search: {error.missed}" in told[0]
    assert "AttractorOptions(also=" in told[0]


def test_the_share_of_a_missed_basin_is_the_error_of_labels(missed):
    system, _, found = missed
    basins, _ = mapped(system, (0.3 - 5e-5, 0.3 + 5e-5, 1000), found)
    error = basins.label_error(1000)
    assert error.cells == 1000
    assert abs(error.wrong / 1000 - 0.1) < 4.0 * np.sqrt(0.1 * 0.9 / 1000)


def test_a_missed_attractor_is_found_from_the_state_that_was_told(missed):
    system, middle, _ = missed
    options = replace(FEW, also=[[middle]])
    found = find_attractors(system, {}, {"x": (-1, 1)}, options=options)
    assert sorted(found.points[name][0, 0] for name in found.names) == pytest.approx([0.0, middle], abs=1e-12)
    basins, told = mapped(system, (0.3 - 5e-5, 0.3 + 5e-5, 1000), found)
    inside = found.names[int(np.argmax([found.points[name][0, 0] for name in found.names]))]
    assert basins.fractions()[inside] == pytest.approx(0.1, abs=2e-3)
    assert (basins.label_error(300).wrong, told) == (0, [])


def test_states_to_start_from_are_checked(missed):
    system, *_ = missed
    with pytest.raises(InputError, match=r"^AttractorOptions.also = \(0\.3, 0\.2\): must be states from which motions"):
        find_attractors(system, {}, {"x": (-1, 1)}, options=AttractorOptions(also=[(0.3, 0.2)]))
    with pytest.raises(InputError, match=r"^AttractorOptions.also = "):
        AttractorOptions(also=[["x"]])


def test_an_error_of_labels_is_kept_and_read_from_earlier_files(missed, tmp_path):
    system, _, found = missed
    basins, _ = mapped(system, (0.3 + 1e-6, 0.3 + 9e-6, 100), found)
    assert load(basins.save(tmp_path / "a.nc")).noted_error == basins.noted_error
    kept = json.loads(json.dumps(basins.noted_error.as_data()))
    assert label_error_of(kept) == basins.noted_error
    earlier = {name: kept[name] for name in ("wrong", "cells", "bound", "tolerance")}
    earlier |= {"wrong_by_events": 0, "cells_by_events": 0}
    assert label_error_of(earlier) == LabelError(100, 100, 1.0, 1e-12)
    with pytest.raises(InputError, match="label_error"):
        label_error_of(kept | {"missed": 3.0})


def test_a_motion_that_creeps_for_longer_than_it_is_followed_is_no_wrong_label():
    """x -> x + e (x - x^3)/2: two rests at -1 and 1 with the multiplier 1 - e, basins x < 0 and x > 0."""
    creeping = Map(("x",), {"e": 1e-3}, {"x": "x + e*(x - x**3)/2"})
    basins, told = mapped(creeping, (-2, 2, 100), {"options": FEW})
    assert (basins.noted_error.wrong, basins.noted_error.nowhere, told) == (0, 0, [])


def _cases(count):
    rng = np.random.default_rng(20)
    for _ in range(count):
        width = float(10.0 ** rng.uniform(-6.0, -4.0))
        place, unit = float(10.0 ** rng.uniform(-2.0, -0.3)), float(10.0 ** rng.integers(-9, 10))
        yield place, width, float(rng.uniform(-0.8, 0.9)), float(rng.uniform(0.1, 0.95)), unit


CASES = list(_cases(24))


@pytest.mark.parametrize(("place", "width", "rate", "own", "unit"), guarding(CASES, *CASES[:3], campaign=8))
def test_windows_that_a_search_has_missed_are_wrong_labels(place, width, rate, own, unit):
    system, middle = with_window(place, width, rate, own, unit)
    found = find_attractors(system, {}, {"x": (-unit, unit)}, options=FEW)
    assert len(found.names) == 1
    low, high = (place + 0.1 * width) * unit, (place + 0.9 * width) * unit
    basins, _ = mapped(system, (low, high, 100), found)
    error = basins.noted_error
    assert error.wrong == error.cells == error.nowhere == 100
    point = float(error.missed.removeprefix("period-1 through [").removesuffix("]"))
    assert abs(point - middle) < 1e-8 * abs(middle)


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ["cycle", "island"])
def test_what_a_search_of_a_flow_has_missed_is_a_wrong_label(kind):
    """Rest at 0 draws all motions but those within a hundredth of (3, 0), on a cycle or on circles without end."""
    near = "((x - 3)**2 + y**2)*10000"
    inside = {
        "cycle": {"x": "-y + 10*(x - 3)*(0.25 - " + near + ")", "y": "(x - 3) + 10*y*(0.25 - " + near + ")"},
        "island": {"x": "-y", "y": "x - 3"},
    }[kind]
    edge = f"{near} - 1"
    system = HybridSystem(
        ("x", "y"), {}, {"out": Mode({"x": "-x", "y": "-y"}, domain=edge), "in": Mode(inside, domain=f"-({edge})")},
        [Transition("out", "in", edge, -1), Transition("in", "out", edge, 1)],
    )  # fmt: skip
    options = AttractorOptions(starts=16, samples=200, interval=0.7)
    found = find_attractors(system, {}, {"x": (-4, 4), "y": (-4, 4)}, options=options)
    assert found.names == ("rest",)
    with warnings.catch_warnings(record=True):
        warnings.simplefilter("always")
        basins = map_basins(system, {}, {"x": (2.994, 3.006, 8), "y": (-0.006, 0.006, 8)}, found)
    error = basins.label_error(64, by_events=0)
    assert basins.fractions()["rest"] == 1.0
    assert (error.wrong, error.nowhere, error.cells) == (64, 64, 64)
    assert error.missed.startswith("limit cycle through") == (kind == "cycle")
    assert bool(error.missed) == (kind == "cycle")
