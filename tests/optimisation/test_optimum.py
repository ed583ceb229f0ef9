"""An optimum as a result: values, tables, words and files, also without constraints and after an interrupt."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import saltus
from explained import unexplained
from saltus import InputError, find_orbit, optimise
from saltus.results import Optimum

A1 = "amplitude(x, 1)"


@pytest.fixture(scope="module")
def start(duffing):
    return find_orbit(duffing, {"b": 0.0, "A": 1.0, "c": 0.4, "w": 0.6}, [0.0, 0.0])


@pytest.fixture(scope="module")
def free(start):
    return optimise(start, maximise=A1, vary={"w": (None, None)})


@pytest.fixture(scope="module")
def held(start):
    limits = {"max_v": (-1.0, 3.0), "stable": True}
    return optimise(start, maximise=A1, vary={"w": (0.5, None), "c": (0.1, 2.0)}, subject_to=limits)


def test_values_are_asked_for_by_name(held):
    assert held["w"] == held.values[0] == held.orbit.parameters["w"]
    assert held["c"] == pytest.approx(0.1, rel=1e-12)
    with pytest.raises(InputError, match="parameter = 'k': must be one of w, c"):
        held["k"]


def test_the_best_objective_and_what_is_seen_are_those_of_the_orbit(held):
    assert held.best == pytest.approx(held.orbit.observe(A1)[A1], rel=1e-14)
    table = held.to_dataframe()
    assert list(table.index) == ["max_v", "max_v", "stable", "w", "c", "c"]
    assert table["side"].tolist() == ["lower", "upper", "upper", "lower", "lower", "upper"]
    assert table["bound"].tolist() == [-1.0, 3.0, 0.999, 0.5, 0.1, 2.0]
    v, largest = held.orbit.max["v"], np.abs(held.orbit.multipliers).max()
    assert table["value"].tolist() == pytest.approx([v, v, largest, held["w"], held["c"], held["c"]], rel=1e-9)


def test_active_are_those_with_a_multiplier_and_their_signs_are_those_of_a_maximum(held):
    assert set(held.active) == {"max_v", "c"}
    assert held.active["max_v"] > 0.0  # more is allowed, more is reached
    assert held.active["c"] < 0.0  # less damping would give more
    w, c = held["w"], held["c"]
    assert w / np.hypot(1.0 - w**2, c * w) == pytest.approx(3.0, rel=1e-9)


def test_the_path_leads_from_the_start_to_the_optimum(held, free):
    for found in (held, free):
        assert found.path[0].tolist() == found.start.tolist()
        assert found.path[-1].tolist() == found.values.tolist()
        assert found.path_objective[-1] == found.best
        assert len(found.path) == len(found.path_objective) <= found.orbits


def test_the_words_of_an_optimum_name_what_holds_it(held):
    lines = repr(held).splitlines()
    assert lines[0] == f"Optimum of Duffing: greatest {A1} = {held.best:.9g}"
    assert lines[1:3] == [f"  w = {held['w']:.9g}, from 0.6", "  c = 0.1, from 0.4"]
    assert lines[3:5] == [
        f"  active: max_v <= 3, multiplier {held.active['max_v']:.6g}",
        f"  active: c >= 0.1, multiplier {held.active['c']:.6g}",
    ]
    assert lines[5] == f"  stable orbit of period {held.orbit.period:.9g}"
    assert lines[-1] == f"  the optimum is found; {held.orbits} orbits"
    stable = replace(held, multipliers=np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]), goal="minimise", notes=("a note",))
    lines = repr(stable).splitlines()
    assert lines[0].startswith(f"Optimum of Duffing: least {A1}")
    assert lines[3] == "  active: largest |multiplier| <= 0.999, multiplier 2"
    assert lines[-2] == "  a note"


def test_without_constraints_there_are_none_in_table_and_words(free):
    assert (free.constraints, free.sides, free.active) == ((), (), {})
    assert free.to_dataframe().shape == (0, 4)
    assert "active" not in repr(free)


KINDS = {
    "free": {},
    "interrupted": {"stopped": "interrupted: the best so far", "mismatch": np.nan, "curvature": np.nan},
    "held in all directions": {"curvature": np.inf, "notes": ("a note", "é")},
}


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_an_optimum_without_constraints_is_read_back_equal(free, tmp_path, kind):
    one = replace(free, **KINDS[kind])
    again = saltus.load(one.save(tmp_path / "optimum.nc"))
    assert unexplained(again.to_xarray()) == []
    assert isinstance(again, Optimum)
    assert again == one
    assert pickle.loads(pickle.dumps(one)) == one
    assert again.constraints == ()
    assert again.path.tolist() == one.path.tolist()
    assert repr(again) == repr(one)


def test_an_optimum_with_constraints_is_read_back_equal(held):
    again = Optimum.from_xarray(held.to_xarray())
    assert again == held
    assert again.active == held.active
    assert again.to_dataframe().equals(held.to_dataframe())
    assert again != replace(held, goal="minimise")
    assert again != replace(held, limits=held.limits + 1e-15)


def changed(dataset, name, value):
    found = dataset.copy(deep=True)
    found[name] = (found[name].dims, np.full(found[name].shape, value))
    return found


SPOILED = {
    "goal": (lambda d: d.assign_attrs(goal="better"), "goal = 'better': must be one of maximise, minimise"),
    "parameter": (lambda d: d.assign_coords(over=["w", "q"]), "over = 'q': must be one of"),
    "side": (lambda d: changed(d, "side", "left"), "side = 'left': must be one of lower, upper"),
    "values": (lambda d: d.assign(value=d["value"] * 1.001), "variable 'value' = .*be the parameters of the orbit"),
    "best": (lambda d: d.assign_attrs(best=np.nan), "attribute 'best' = nan"),
    "residual": (lambda d: d.assign_attrs(residual=-1.0), "attribute 'residual' = -1.0"),
    "mismatch": (lambda d: d.assign_attrs(mismatch=-1.0), "attribute 'mismatch' = -1.0"),
    "orbits": (lambda d: d.assign_attrs(orbits=2.5), "attribute 'orbits' = 2.5: must be a whole number"),
    "multipliers": (lambda d: changed(d, "multipliers", np.nan), "variable 'multipliers'"),
    "no path": (lambda d: d.drop_vars("path"), "path"),
}  # fmt: skip


@pytest.mark.parametrize("what", SPOILED)
def test_a_file_whose_parts_do_not_agree_is_refused(held, what):
    spoil, message = SPOILED[what]
    with pytest.raises(InputError, match=message):
        Optimum.from_xarray(spoil(held.to_xarray()))


def test_arrays_of_an_optimum_cannot_be_changed(held):
    for name in ("values", "start", "seen", "limits", "multipliers", "path", "path_objective"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(held, name)[...] = 0.0
