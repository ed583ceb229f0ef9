"""Motions of maps as points and curves."""

import numpy as np
import pytest

import known_maps
import saltus
from saltus.errors import InputError
from saltus.explorer.visits import names_of, visited


@pytest.fixture(scope="module")
def twice():
    """Return the stable orbit of period 2 of the logistic map at r = 3.2."""
    return saltus.solve_orbit(known_maps.logistic(), x0=[0.5], period=2)


def test_a_series_is_joined_and_counted():
    motion = saltus.iterate(known_maps.henon(), x0=[0.1, 0.1], n=20, discard=5)
    path = visited(motion, ("n", "y"), closed=False)
    assert np.array_equal(path.events[:, 0], np.arange(5.0, 26.0))
    assert np.array_equal(path.events[:, 1], motion.states[:, 1])
    assert np.array_equal(path.aids[0], path.events)
    assert (path.points, path.curves) == (True, [])
    assert visited(motion, ("x", "y"), closed=False).aids == []


def test_points_of_a_cobweb_lie_on_the_graph_and_the_way_ends_on_the_diagonal(twice):
    path = visited(twice, ("x", "next x"), closed=True)
    assert np.array_equal(path.events[:, 1], path.events[::-1, 0])  # each is the image of the other
    (graph,) = path.curves
    x, image = graph.T
    assert image == pytest.approx(3.2 * x * (1.0 - x), rel=1e-14)
    assert graph[0, 0] < path.events.min()
    assert graph[-1, 0] > path.events.max()
    diagonal, way = path.aids
    assert np.array_equal(diagonal[:, 0], diagonal[:, 1])
    assert np.array_equal(way[0], way[-1])
    assert np.all((np.diff(way, axis=0) == 0.0).any(axis=1))  # each step is level or upright


def test_a_graph_has_a_curve_for_each_piece():
    shuttle = saltus.solve_orbit(known_maps.tent(), x0=[-0.4])
    path = visited(shuttle, ("x", "next x"), closed=True)
    assert path.modes == [0]
    both = saltus.iterate(known_maps.tent(), {"mu": 0.2}, x0=[-0.4], n=3)
    assert visited(both, ("x", "next x"), closed=False).modes == [0, 1]


def test_the_last_state_of_a_motion_has_no_next_one_here():
    motion = saltus.iterate(known_maps.henon(), x0=[0.1, 0.1], n=4)
    assert len(visited(motion, ("x", "next y"), closed=False).events) == 4


def test_names_are_those_of_time_states_images_and_outputs(twice):
    assert names_of(known_maps.henon()) == ["n", "x", "y", "next x", "next y"]
    with pytest.raises(InputError, match="nothing"):
        visited(twice, ("n", "nothing"), closed=True)
