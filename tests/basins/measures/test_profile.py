"""Erosion profiles of two basins whose common boundary is where one says."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, InputError, Mode
from saltus.basins.measures.erosion import ErosionProfile
from saltus.basins.measures.integrity import local_integrity
from saltus.basins.measures.profile import erosion_profile
from saltus.ensemble.traps import DIVERGED, UNDECIDED, Ellipsoids, Traps
from saltus.errors import ConvergenceError
from saltus.options import BasinOptions, ErosionOptions
from saltus.plotting.erosion import plot_erosion

SYSTEM = HybridSystem(
    ("x",), {"a": 0.0, "w": 1.0}, {"slope": Mode({"x": "-(x - a)*(x**2 - 1)"})}, phase=("s", "w"), name="two valleys"
)
"""Attractors at -1 and 1 for -1 < a < 1, and the boundary between their basins at a."""

GRID = {"x": (-2.0, 2.0, 80)}
VALUES = [-0.51, -0.11, 0.33, 0.62]
HALF = 0.025


def valleys(parameters):
    """Both attractors, in another order where a > 0, and only the left one for a > 0.5."""
    sides = [("left", -1.0), ("right", 1.0)][:: 1 if parameters["a"] < 0.0 else -1]
    sides = [side for side in sides if side[0] == "left" or parameters["a"] < 0.5]
    traps = Ellipsoids(
        np.array([[x] for _, x in sides]), np.full((len(sides), 1, 1), 20.0), np.arange(len(sides), dtype=np.uint8)
    )
    return SimpleNamespace(
        system=SYSTEM,
        parameters=dict(parameters),
        names=tuple(name for name, _ in sides),
        labels={name: i for i, (name, _) in enumerate(sides)} | {"diverged": DIVERGED, "undecided": UNDECIDED},
        points={name: np.array([[x]]) for name, x in sides},
        traps=Traps(1, traps),
        interval=None,
        kinds={},
        notes={},
        measured_error=0.0,
    )


@pytest.fixture(scope="module")
def profile():
    return erosion_profile(
        SYSTEM, "a", VALUES, GRID, options=ErosionOptions(attractors=valleys, basins=BasinOptions(longest=12))
    )


def test_volumes_and_balls_are_those_of_the_boundary_at_every_value(profile):
    a = np.array(VALUES)
    assert profile.attractors == ("left", "right")
    assert profile.of("GIM", "left") == pytest.approx(2.0 + a, abs=HALF)
    assert profile.of("LIM", "left") == pytest.approx(np.minimum(1.0 + a, 1.0), abs=HALF)
    assert profile.of("IF", "left") == pytest.approx(1.0 + 0.5 * a, abs=1.5 * HALF)
    assert profile.of("GIM", "right")[:3] == pytest.approx(2.0 - a[:3], abs=HALF)
    assert profile.of("LIM", "right")[:3] == pytest.approx(np.minimum(1.0 - a[:3], 1.0), abs=HALF)
    assert profile.errors[0, 0].tolist() == pytest.approx([HALF, HALF, 1.5 * HALF])


def test_a_ball_clipped_by_the_window_is_told(profile):
    clipped = profile.clipped[:, :, profile.measures.index("LIM")]
    assert clipped.tolist() == [[False, True], [False, True], [True, False], [True, False]]


def test_an_attractor_that_is_not_there_has_no_measures(profile):
    assert np.isnan(profile.found[3, 1]).all()
    assert (profile.notes[3, 1] == "there is no attractor of this name").all()
    assert np.isfinite(profile.found[:3]).all()


def test_attractors_are_followed_by_their_points_where_names_pass_on():
    def renamed(parameters):
        """Names by place, from the right: where the one on the right is lost, the left one has its name."""
        found = valleys(parameters)
        order = sorted(found.names, reverse=True)
        names = {name: f"period-1 {letter}" for name, letter in zip(order, "AB", strict=False)}
        found.names = tuple(names[name] for name in found.names)
        found.labels = {names.get(name, name): label for name, label in found.labels.items()}
        found.points = {names[name]: points for name, points in found.points.items()}
        return found

    options = ErosionOptions(measures=("GIM",), attractors=renamed, basins=BasinOptions(longest=12))
    left = 2.0 + np.array(VALUES)
    by_name = erosion_profile(SYSTEM, "a", VALUES, GRID, options=options)
    assert by_name.of("GIM", "period-1 A")[3] == pytest.approx(left[3], abs=HALF)  # the left one's
    followed = erosion_profile(SYSTEM, "a", VALUES, GRID, options=replace(options, within=0.5))
    assert followed.of("GIM", "period-1 B") == pytest.approx(left, abs=HALF)
    assert math.isnan(followed.of("GIM", "period-1 A")[3])


def test_an_attractor_that_is_new_has_a_new_name():
    def moving(parameters):
        found = valleys(parameters)
        if parameters["a"] > 0.0:
            found.points = {name: points + 0.01 for name, points in found.points.items()}
        return found

    found = erosion_profile(
        SYSTEM,
        "a",
        VALUES[1:3],
        GRID,
        options=ErosionOptions(measures=("GIM",), attractors=moving, within=1e-3, basins=BasinOptions(longest=12)),
    )
    assert found.attractors == ("left", "right", "right (2)", "left (2)")


def test_a_profile_is_saved_and_read_back_equal(profile, tmp_path):
    again = saltus.load(profile.save(tmp_path / "profile.nc"))
    assert isinstance(again, ErosionProfile)
    assert again == profile
    assert again.grid["ranges"] == {"x": [-2.0, 2.0, 80]}
    assert profile.to_xarray()["found"].sel(attractor="left", measure="GIM").values == pytest.approx(
        profile.of("GIM", "left")
    )


def test_a_file_whose_values_do_not_ascend_is_refused(profile):
    data = profile.to_xarray()
    with pytest.raises(InputError, match="variable 'value' = '0.33, -0.11': must be ascending, each once"):
        ErosionProfile.from_xarray(data.isel(value=[0, 2, 1, 3]))
    with pytest.raises(InputError, match="variable 'value'"):
        ErosionProfile.from_xarray(data.isel(value=slice(0)))


def test_measures_of_ones_own_are_taken():
    measures = {
        "half": partial(local_integrity, weights={"x": 2.0}),
        "cells": lambda basins, name: int((basins.labels == basins.attractors.labels[name]).sum()),
    }
    found = erosion_profile(
        SYSTEM,
        "a",
        [-0.51],
        GRID,
        options=ErosionOptions(measures=measures, attractors=valleys, basins=BasinOptions(longest=12)),
    )
    assert found.of("half", "left") == pytest.approx([0.245], abs=0.5 * HALF)
    assert found.of("cells", "left") == pytest.approx([30.0])
    assert math.isnan(found.errors[0, 0, 1])


def test_every_measure_can_be_followed():
    found = erosion_profile(
        SYSTEM,
        "a",
        [-0.11],
        GRID,
        options=ErosionOptions(
            measures=("stability", "fatal", "S_b", "S_bb", "exponent"),
            attractors=valleys,
            basins=BasinOptions(longest=12),
        ),
    )
    # centres of cells next to the boundary are at -0.125 and -0.075, and it cuts one of 16 boxes 3 to 2
    cut = -0.6 * math.log(0.6) - 0.4 * math.log(0.4)
    for name, share, fatal in (("left", 1.89 / 4.0, 0.925), ("right", 2.11 / 4.0, 1.125)):
        assert found.of("stability", name)[0] == pytest.approx(share, abs=2.0 * found.errors[0, 0, 0])
        assert found.of("fatal", name)[0] == pytest.approx(fatal)
        assert found.of("S_b", name)[0] == pytest.approx(cut / 16.0)
        assert found.of("S_bb", name)[0] == pytest.approx(cut)
        assert found.of("exponent", name)[0] == pytest.approx(1.0)


def test_what_cannot_be_measured_is_noted():
    def lost(parameters):
        if parameters["a"] < 0.0:
            raise ConvergenceError("attractors", 0.1, 200)
        return valleys(parameters)

    small = {"x": (-0.9, 0.9, 40)}
    found = erosion_profile(
        SYSTEM,
        "a",
        [-0.51],
        small,
        options=ErosionOptions(measures=("GIM", "LIM"), attractors=valleys, basins=BasinOptions(longest=12)),
    )
    assert np.isnan(found.of("LIM", "left")[0])
    assert found.notes[0, 0, 1] == "x of 'left' = -1.0: must be within the window, from -0.9 to 0.9; map a larger one"
    found = erosion_profile(
        SYSTEM, "a", [-0.51, 0.33], GRID, options=ErosionOptions(attractors=lost, basins=BasinOptions(longest=12))
    )
    assert (found.notes[0] == "attractors: no convergence, residual 0.1 after 200 iterations").all()
    assert np.isnan(found.found[0]).all()
    assert np.isfinite(found.found[1]).all()
    assert found.stopped == "all 2 values done"


def test_an_interrupted_profile_keeps_what_is_done_and_goes_on_from_its_stores(tmp_path):
    calls = []

    def told(progress):
        calls.append(progress)
        if progress.done == 2:
            raise KeyboardInterrupt

    run = partial(
        erosion_profile,
        SYSTEM,
        "a",
        VALUES[:3],
        GRID,
        options=ErosionOptions(attractors=valleys, basins=BasinOptions(longest=12)),
        path=tmp_path,
    )
    first = run(progress=told)
    assert first.stopped == "interrupted: 2 of 3 values done"
    assert np.isfinite(first.found[:2]).all()
    assert np.isnan(first.found[2]).all()
    assert (first.notes[2] == "not computed").all()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a=-0.11.zarr", "a=-0.51.zarr"]
    assert calls[0].text.startswith("a = -0.51: left 37.")
    again = run()
    assert again.stopped == "all 3 values done"
    assert again == erosion_profile(
        SYSTEM, "a", VALUES[:3], GRID, options=ErosionOptions(attractors=valleys, basins=BasinOptions(longest=12))
    )


def test_a_bar_counts_the_values(capsys):
    erosion_profile(
        SYSTEM,
        "a",
        VALUES[:2],
        GRID,
        options=ErosionOptions(measures=("GIM",), attractors=valleys, basins=BasinOptions(longest=12)),
        progress=True,
    )
    out, err = capsys.readouterr()
    assert not out
    assert "100.0 %" in err
    assert "a = -0.11: left" in err


@pytest.mark.campaign
@pytest.mark.thorough
def test_attractors_are_found_again_at_each_value_by_themselves():
    found = erosion_profile(SYSTEM, "a", [-0.2, 0.3], GRID)
    a, k = np.array([-0.2, 0.3]), found.measures.index("GIM")
    assert len(found.attractors) == 2
    assert sorted(found.found[0, :, k]) == pytest.approx(sorted((2.0 + a[0], 2.0 - a[0])), abs=2.0 * HALF)
    assert sorted(found.found[1, :, k]) == pytest.approx(sorted((2.0 + a[1], 2.0 - a[1])), abs=2.0 * HALF)


def test_bad_input_is_told():
    with pytest.raises(InputError, match="values = '0.2, 0.1': must be ascending, each once"):
        erosion_profile(SYSTEM, "a", [0.2, 0.1], GRID)
    with pytest.raises(
        InputError, match="ErosionOptions.measures = 'LIN': must be one of GIM, LIM, IF.*did you mean 'LIM'?"
    ):
        erosion_profile(SYSTEM, "a", [0.2], GRID, options=ErosionOptions(measures=["LIN"]))
    with pytest.raises(InputError, match=r"ErosionOptions.measures\['own'\] = 3: must be a function"):
        erosion_profile(SYSTEM, "a", [0.2], GRID, options=ErosionOptions(measures={"own": 3}))
    with pytest.raises(InputError, match="ErosionOptions.measures = .*must be at least one"):
        erosion_profile(SYSTEM, "a", [0.2], GRID, options=ErosionOptions(measures=[]))
    with pytest.raises(InputError, match="'b'"):
        erosion_profile(SYSTEM, "b", [0.2], GRID)
    with pytest.raises(InputError, match="ErosionOptions.attractors = 3: must be a function of the parameters"):
        erosion_profile(SYSTEM, "a", [0.2], GRID, options=ErosionOptions(attractors=3))
    with pytest.raises(InputError, match="ErosionOptions.within = -1: must be a finite number > 0"):
        erosion_profile(SYSTEM, "a", [0.2], GRID, options=ErosionOptions(within=-1))
    with pytest.raises(InputError, match="progress = 3: must be True for a bar, or a function of a saltus.Progress"):
        erosion_profile(SYSTEM, "a", [0.2], GRID, progress=3)
    with pytest.raises(InputError, match="system = 3: must be a HybridSystem"):
        erosion_profile(3, "a", [0.2], GRID)


def test_a_measure_that_was_not_taken_is_told(profile):
    with pytest.raises(InputError, match="measure = 'S_b': must be one of GIM, LIM, IF"):
        profile.of("S_b", "left")
    with pytest.raises(InputError, match="attractor = 'lef': must be one of left, right; did you mean 'left'?"):
        profile.of("IF", "lef")


def test_a_profile_says_what_it_holds(profile):
    text = repr(profile)
    assert "ErosionProfile of two valleys: a from -0.51 to 0.62, 4 values" in text
    assert "2 clipped by the window" in text
    assert "1 missing" in text


# pictures


@pytest.fixture
def pyplot():
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def test_one_measure_is_drawn_as_it_is_with_its_error(profile, pyplot):
    ax = plot_erosion(profile, "LIM")
    drawn = [line for line in ax.lines if line.get_linestyle() != "None" and len(line.get_xdata())]
    assert drawn[0].get_ydata() == pytest.approx(profile.of("LIM", "left"))
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["left", "right"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "LIM")
    bands = [band.get_paths()[0].get_extents().height for band in ax.collections]
    assert len(bands) == 2
    hollow = [line for line in ax.lines if line.get_markerfacecolor() == "white"]
    assert sorted(len(line.get_xdata()) for line in hollow) == [2, 2]


def test_several_measures_are_shares_of_their_largest_value(profile, pyplot):
    ax = plot_erosion(profile)
    drawn = [line for line in ax.lines if line.get_linestyle() != "None" and len(line.get_xdata())]
    assert len(drawn) == 6
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["left", "right", "GIM", "LIM", "IF"]
    assert all(np.nanmax(line.get_ydata()) == pytest.approx(1.0) for line in drawn)
    assert plot_erosion(profile, legend=False).get_legend() is None


def test_a_picture_of_something_else_is_told(profile, pyplot):
    with pytest.raises(InputError, match="measure = 'S_bb': must be one of GIM, LIM, IF"):
        plot_erosion(profile, "S_bb")
