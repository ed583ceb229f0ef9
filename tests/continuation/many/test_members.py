"""Families of branches: each member against closed forms, wherever it is computed; what fails; files; input."""

from __future__ import annotations

import itertools
import math
import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import saltus
import systems
from oracles.closed_forms import HENON, LOGISTIC, ImpactOrbit, henon_fixed_point
from saltus import InputError, StepControl, continue_family, continue_orbit, processes, solve_orbit
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.options import BranchOptions
from saltus.results import Family
from selection import guarding

GAPS = (1.2, 0.8, 1.0, 1.1)
BOUNDS = (0.05, 6.0)
MIXED = {"d": [1.0, 9.0, 0.9], "c": [0.1, 0.1, 0.12]}
LOCATED = 1e-9
"""Special points are located to 1e-10 in units of the interval."""

LONG = BranchOptions(StepControl(largest=2e-3, max_points=10**6))
"""Some 2000 points a branch: more than a second."""

UNEQUAL = BranchOptions(StepControl(largest=2e-4, max_points=10**6), directions="down", stop_at="SN")
"""From A = 1 down to the fold: a few points where d = 8.5, thousands where it is near 1."""


@pytest.fixture(scope="module")
def orbit(impact_oscillator):
    return solve_orbit(impact_oscillator, {"w": 1.1}, [("free", "impact", [1.0, -1.3, 0.1], 5.71)])


@pytest.fixture(scope="module")
def family(orbit) -> Family:
    return continue_family(orbit, "A", {"d": GAPS}, BOUNDS, workers=1)


@pytest.fixture(scope="module")
def henon():
    """A fixed point of Henon's map at a = 0.2, b = 0.3; there is none where a < -(1 - b)^2 / 4."""
    x = henon_fixed_point(0.2, 0.3)
    system = systems.carried_map(("x", "y"), {"a": 0.2, "b": 0.3}, HENON)
    return solve_orbit(system, {}, [("carry", "map", [x, x, 0.0], 1.0)])


@pytest.fixture(scope="module")
def mixed(orbit) -> Family:
    """Members with impacts, with and without special points, and one that is not reached."""
    return continue_family(orbit, "A", MIXED, (0.5, 6.0), options=BranchOptions(stop_at="GR"), workers=1)


# members


@pytest.mark.parametrize("index", range(len(GAPS)))
def test_special_points_of_each_member_are_the_closed_forms(family, index):
    closed = ImpactOrbit(w=1.1, d=GAPS[index])
    expected = {
        "GR1": closed.A_grazing,
        "SN1": closed.amplitude(closed.U_fold),
        "PD1": closed.amplitude(closed.U_doubling),
    }
    found = {point.label: point.parameters["A"] for point in family[index].special_points}
    assert found == pytest.approx(expected, abs=LOCATED)


def test_the_member_at_the_orbit_s_own_values_is_the_orbit_s_branch(orbit, family):
    assert family[GAPS.index(1.0)] == continue_orbit(orbit, "A", BOUNDS)


@pytest.mark.parametrize("gap", [0.8, 1.2])
def test_a_member_is_the_branch_of_the_orbit_at_its_values(impact_oscillator, family, gap):
    own = solve_orbit(impact_oscillator, {"w": 1.1, "d": gap}, [("free", "impact", [gap, -1.3, 0.1], 5.71)])
    member = family[GAPS.index(gap)]
    start = np.argmin(np.abs(member.values - 1.0))
    assert member.values[start] == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(member.x0[start], own.x0, atol=1e-9)
    alone = continue_orbit(own, "A", BOUNDS)
    assert member.stopped == alone.stopped
    assert [point.label for point in member.special_points] == [point.label for point in alone.special_points]


def test_members_have_their_values_to_the_last_digit(orbit):
    gaps = np.linspace(0.7, 1.3, 7)
    family = continue_family(orbit, "A", {"d": gaps}, (0.9, 1.1), workers=1)
    assert [branch.parameters["d"] for branch in family] == gaps.tolist()
    np.testing.assert_array_equal(family.over["d"], gaps)


def test_the_order_of_the_values_does_not_matter(orbit, family):
    order = [2, 0, 3, 1]
    again = continue_family(orbit, "A", {"d": [GAPS[i] for i in order]}, BOUNDS, workers=1)
    assert list(again) == [family[i] for i in order]


def test_options_are_those_of_each_branch(orbit):
    options = {"directions": "up", "events": {"max_v": 2.5}, "stop_at": ["max_v"], "steps": StepControl(largest=0.05)}
    family = continue_family(orbit, "A", {"d": [1.0, 1.1]}, BOUNDS, options=BranchOptions(**options), workers=1)
    assert family[0] == continue_orbit(orbit, "A", BOUNDS, **options)
    assert family[1].special_points[-1].type == "max_v"
    assert family.options == family[0].options


def test_the_way_passes_a_grazing_into_motion_without_impacts(orbit):
    """At A = 1 there are no impacts where d is beyond A / impedance = 4.2."""
    family = continue_family(orbit, "A", {"d": [9.0]}, (0.5, 1.5), workers=1)
    amplitude, _ = ImpactOrbit(w=1.1).linear_response(1.0)
    np.testing.assert_allclose(family[0].column("max_x"), amplitude * family[0].values, rtol=1e-9)


def test_several_parameters_vary_together(orbit):
    family = continue_family(orbit, "A", {"d": [1.1, 0.9], "c": [0.12, 0.08]}, BOUNDS, workers=1)
    for branch, d, c in zip(family, (1.1, 0.9), (0.12, 0.08), strict=True):
        assert (branch.parameters["d"], branch.parameters["c"]) == (d, c)
        assert branch["GR1"].parameters["A"] == pytest.approx(ImpactOrbit(w=1.1, d=d, c=c).A_grazing, abs=LOCATED)


def test_where_one_parameter_after_the_other_is_blocked_the_way_has_stairs():
    """Along a alone the fixed point ends at -0.1225, while b is still 0.3."""
    system = systems.carried_map(
        ("x", "y"), {"a": 0.2, "b": 0.3, "shift": 0.0}, HENON | {"x": "a + shift - x**2 + b*y"}
    )
    x = henon_fixed_point(0.2, 0.3)
    start = solve_orbit(system, {}, [("carry", "map", [x, x, 0.0], 1.0)])
    family = continue_family(start, "shift", {"a": [-0.5], "b": [-0.9]}, (-0.1, 0.1), workers=1)
    row = np.argmin(np.abs(family[0].values))
    assert family[0].x0[row, 0] == pytest.approx(henon_fixed_point(-0.5, -0.9), abs=1e-10)


def test_a_group_sets_all_its_members(impact_oscillator):
    system = type(impact_oscillator).from_definition(
        impact_oscillator.definition() | {"groups": {"spring": ["k", "d"]}}
    )
    start = solve_orbit(system, {"w": 1.1}, [("free", "impact", [1.0, -1.3, 0.1], 5.71)])
    family = continue_family(start, "A", {"spring": [1.05]}, (0.9, 1.1), workers=1)
    assert (family[0].parameters["k"], family[0].parameters["d"]) == (1.05, 1.05)
    assert list(family.over) == ["spring"]


# failures


def test_a_member_without_an_orbit_fails_with_its_reason_and_the_others_are_kept(henon):
    family = continue_family(henon, "b", {"a": [0.3, -0.2, 0.1]}, (0.2, 0.4), workers=1)
    assert [branch is None for branch in family] == [False, True, False]
    assert dict(family.failures) == {1: "no way from a = 0.1 to -0.2: saddle-node at a = -0.1225"}
    assert not family.interrupted
    with pytest.raises(InputError, match=r"^index = 1: must be that of a member with a branch; no way from a = 0\.1 "):
        family[1]


def test_a_grazing_at_which_branches_stop_stops_the_way_as_well(mixed):
    (reason,) = mixed.failures.values()
    assert list(mixed.failures) == [1]
    assert reason.startswith("no way from d = 1 to 9: ")
    assert reason.endswith(": grazing")


@pytest.fixture
def at_once(monkeypatch):
    """Start processes at once, however little there is to do."""
    monkeypatch.setattr(processes, "_TRIAL", 0.0)


@pytest.mark.campaign
@pytest.mark.usefixtures("at_once")
def test_members_of_a_worker_that_is_killed_are_told(orbit):
    def kill(progress):
        for process in multiprocessing.active_children():
            process.kill()

    family = continue_family(orbit, "A", {"d": GAPS}, BOUNDS, options=LONG, workers=2, progress=kill)
    assert len(family.failures) == len(GAPS)
    assert all(reason.startswith("its worker was lost: BrokenProcessPool") for reason in family.failures.values())


# processes and clusters


def test_a_small_family_starts_no_process(orbit, family, monkeypatch):
    monkeypatch.setattr(processes, "Processes", None)
    assert continue_family(orbit, "A", {"d": GAPS}, BOUNDS, workers=2) == family


@pytest.mark.campaign
def test_a_branch_that_takes_long_is_given_up_here_and_traced_by_a_process(orbit, family, monkeypatch):
    monkeypatch.setattr(processes, "_TRIAL", 1e-6)
    assert continue_family(orbit, "A", {"d": GAPS}, BOUNDS, workers=2) == family
    processes.resting.end()
    assert not multiprocessing.active_children()


@pytest.mark.campaign
def test_processes_take_what_is_left_where_they_save_time(orbit, family, monkeypatch):
    traced, pool = [], processes.Processes

    class Counted(pool):
        def submit(self, key, *work):
            traced.append(key)
            super().submit(key, *work)

    monkeypatch.setattr(processes, "Processes", Counted)
    monkeypatch.setattr(processes, "_START", 0.0)
    assert continue_family(orbit, "A", {"d": GAPS}, BOUNDS, workers=2) == family
    assert 2 <= len(traced) < len(GAPS)


@pytest.mark.campaign
@pytest.mark.usefixtures("at_once")
def test_processes_compute_the_same_family(orbit, mixed):
    told, options = [], BranchOptions(stop_at="GR")
    parallel = continue_family(orbit, "A", MIXED, (0.5, 6.0), options=options, workers=2, progress=told.append)
    assert parallel == mixed
    processes.resting.end()
    assert not multiprocessing.active_children()
    assert [progress.done for progress in told] == sorted(progress.done for progress in told)
    assert {progress.total for progress in told} == {3}
    assert told[-1].done == 3
    assert sum(bool(re.search(r"\d+ orbits$", progress.text)) for progress in told) == 2


def test_a_daemonic_process_computes_the_family_itself(orbit, monkeypatch):
    # a worker of Dask is one, and may not start others
    monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", True)
    over = {"d": GAPS[:2]}
    assert continue_family(orbit, "A", over, BOUNDS, workers=2) == continue_family(orbit, "A", over, BOUNDS, workers=1)


@pytest.mark.campaign
def test_a_dask_cluster_computes_the_same_family(orbit, family):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0")
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        assert continue_family(orbit, "A", {"d": GAPS}, BOUNDS, client=client) == family


@pytest.mark.campaign
def test_an_interrupted_dask_cluster_keeps_what_is_done(orbit):
    distributed = pytest.importorskip("distributed")

    def interrupt(progress):
        if progress.done == 1:
            raise KeyboardInterrupt

    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0")
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        short = BranchOptions(StepControl(largest=5e-3))
        family = continue_family(orbit, "A", {"d": GAPS}, BOUNDS, options=short, client=client, progress=interrupt)
    assert family.interrupted
    assert 1 <= sum(branch is not None for branch in family) < len(GAPS)
    assert set(family.failures.values()) == {"interrupted before it was done"}


def test_progress_counts_the_members_that_are_done(orbit):
    told = []
    continue_family(orbit, "A", {"d": [1.0, 1.1]}, (0.9, 1.1), workers=1, progress=told.append)
    assert [(progress.done, progress.total) for progress in told] == [(0, 2), (1, 2), (1, 2), (2, 2)]
    assert [progress.text.split(":")[0] for progress in told] == ["d = 1", "d = 1", "d = 1.1", "d = 1.1"]
    assert told[1].text.endswith(" orbits")


def test_true_shows_a_bar_of_the_members(orbit, capsys):
    continue_family(orbit, "A", {"d": [1.0, 1.1]}, (0.9, 1.1), workers=1, progress=True)
    out, err = capsys.readouterr()
    assert not out
    assert "100.0 %" in err
    assert "d = 1.1: " in err


@pytest.mark.parametrize("progress", ["loud", 1])
def test_progress_is_a_bar_or_a_function(orbit, progress):
    with refuse(f"progress = {progress!r}: must be True for a bar, or a function of a saltus.Progress"):
        continue_family(orbit, "A", {"d": [1.0]}, BOUNDS, progress=progress)


# interrupts

UNDONE = "interrupted before it was done"


def test_an_interrupted_family_keeps_the_members_that_are_done(orbit, family):
    def interrupt(progress):
        if progress.done == 2:
            raise KeyboardInterrupt

    again = continue_family(orbit, "A", {"d": GAPS}, BOUNDS, workers=1, progress=interrupt)
    assert again.interrupted
    assert dict(again.failures) == {0: UNDONE, 1: UNDONE}
    assert (again[2], again[3]) == (family[2], family[3])


def test_a_branch_that_is_interrupted_is_no_member(orbit, monkeypatch):
    examined, examine = itertools.count(), OrbitZeroProblem.examine

    def interrupted(self, point, before):
        if next(examined) == 50:
            raise KeyboardInterrupt
        return examine(self, point, before)

    monkeypatch.setattr(OrbitZeroProblem, "examine", interrupted)
    family = continue_family(orbit, "A", {"d": [1.0]}, BOUNDS, options=LONG, workers=1)
    assert family.interrupted
    assert (family.branches, dict(family.failures)) == ((None,), {0: UNDONE})


@pytest.mark.campaign
@pytest.mark.usefixtures("at_once")
def test_interrupted_processes_give_up_what_is_not_done_and_keep_what_is(orbit):
    """Processes that went on would bring the long members, too: they have them in hand at the interrupt."""

    def interrupt(progress):
        if progress.done == 1:
            raise KeyboardInterrupt

    start = continue_orbit(orbit, "d", (1.0, 8.5), directions="up").solution(-1)
    gaps = [8.5, 1.0, 1.1, 1.2]
    family = continue_family(start, "A", {"d": gaps}, BOUNDS, options=UNEQUAL, workers=2, progress=interrupt)
    assert family.interrupted
    assert [branch is not None for branch in family] == [True, False, False, False]
    assert family[0].special_points[-1].type == "SN"
    assert set(family.failures.values()) == {UNDONE}
    assert not multiprocessing.active_children()


SCRIPT = """
import saltus, saltus.processes, systems
saltus.processes._TRIAL = 0.0
orbit = saltus.solve_orbit(systems.impact_oscillator(), {"w": 1.1}, [("free", "impact", [1.0, -1.3, 0.1], 5.71)])
start = saltus.continue_orbit(orbit, "d", (1.0, 8.5), directions="up").solution(-1)
print("began", flush=True)
steps = saltus.StepControl(largest=LARGEST, max_points=10**6)
options = saltus.options.BranchOptions(steps, directions="down", stop_at="SN")
family = saltus.continue_family(
    start, "A", {"d": [8.5, 1.2, 1.1, 1.0]}, (0.05, 6.0), options=options, workers=2,
    progress=lambda progress: print(progress.done, progress.text, flush=True),
)
print("interrupted" if family.interrupted else "whole", len(family.failures))
"""


def run_script(folder, largest) -> subprocess.Popen[str]:
    path = folder / "script.py"
    path.write_text(SCRIPT.replace("LARGEST", str(largest)))
    places = [str(Path(systems.__file__).parent), str(Path(saltus.__file__).parents[1])]
    return subprocess.Popen(
        [sys.executable, str(path)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(places)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def ends(group):
    """Whether no process of a group is left, after what it takes them to leave."""
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.campaign
def test_a_script_needs_no_guard_and_runs_once(tmp_path):
    out, err = run_script(tmp_path, 0.1).communicate(timeout=120)
    assert err == ""
    assert out.count("began") == 1
    assert out.endswith("whole 0\n")


AT_ONCE = r"0 d = 8\.5: the start"


@pytest.mark.campaign
@pytest.mark.skipif(sys.platform == "win32", reason="groups of processes are signalled")
@pytest.mark.parametrize(
    "after", guarding([AT_ONCE, r"\d d = 1: the start", r"\d d = 8\.5: \d+ orbits"], AT_ONCE, campaign=0)
)
def test_ctrl_c_leaves_no_process_and_no_traceback_behind(tmp_path, after):
    """The terminal sends it to the workers as well, wherever they are: importing, or at work."""
    script = run_script(tmp_path, 2e-4)
    for line in script.stdout:
        if re.match(after, line):
            break
    os.killpg(script.pid, signal.SIGINT)
    out, err = script.communicate(timeout=60)
    assert err == ""
    assert "interrupted" in out
    assert ends(script.pid)


@pytest.mark.campaign
@pytest.mark.skipif(sys.platform == "win32", reason="groups of processes are signalled")
def test_workers_do_not_outlive_a_parent_that_is_killed(tmp_path):
    script = run_script(tmp_path, 2e-4)
    for line in script.stdout:
        if re.match(r"\d d = 1: the start", line):
            break
    script.kill()
    script.wait()
    assert ends(script.pid)
    script.stdout.close()
    script.stderr.close()


# files


@pytest.mark.campaign
def test_a_family_is_saved_and_read_back_equal(mixed, tmp_path):
    again = saltus.load(mixed.save(tmp_path / "family.nc"))
    assert isinstance(again, Family)
    assert again == mixed
    assert dict(again.failures) == dict(mixed.failures)
    for mine, theirs in zip(mixed, again, strict=True):
        assert mine == theirs
    assert {branch.forms for branch in again if branch is not None} == {mixed[0].forms}


@pytest.mark.campaign
def test_members_of_different_signatures_and_ends_survive_a_file(tmp_path, orbit):
    options = BranchOptions(StepControl(initial=1.0, largest=1.0))  # so long that some steps are rejected
    family = continue_family(orbit, "A", {"d": [1.0, 9.0, -0.5]}, (0.9, 1.5), options=options, workers=1)
    lengths = [{len(u) for u in branch.unknowns} for branch in family]
    forms = [branch.forms for branch in family]
    assert forms[0] != forms[1]
    again = Family.load(family.save(tmp_path / "family.nc"))
    assert [branch.forms for branch in again] == forms
    assert [{len(u) for u in branch.unknowns} for branch in again] == lengths
    assert [branch.rejected for branch in again] == [branch.rejected for branch in family]
    assert any(branch.rejected for branch in family)
    assert again == family


def test_the_dataset_is_a_contiguous_ragged_array(family):
    dataset = family.to_xarray()
    assert dataset["count"].dims == ("member",)
    assert dataset["count"].attrs["sample_dimension"] == "point"
    assert dataset["special_count"].attrs["sample_dimension"] == "special"
    assert dataset["count"].values.tolist() == [len(branch) for branch in family]
    assert dataset["special_count"].values.tolist() == [3] * len(GAPS)
    np.testing.assert_array_equal(dataset["d"].values, GAPS)
    for i, branch in enumerate(family):
        points = dataset.isel(point=dataset["point_member"].values == i)
        np.testing.assert_array_equal(points["A"].values, branch.values)
        np.testing.assert_array_equal(points["max_v"].values, branch.column("max_v"))
        special = dataset["special_label"].values[dataset["special_member"].values == i]
        assert special.tolist() == [point.label for point in branch.special_points]


@pytest.mark.campaign
def test_a_parameter_with_the_name_of_a_variable_is_kept_beside_it(tmp_path):
    system = systems.carried_map(("x",), {"a": 2.5, "period": 1.0, "point": 0.0}, LOGISTIC)
    start = solve_orbit(system, {}, [("carry", "map", [0.6, 0.0], 1.0)])
    family = continue_family(start, "a", {"period": [1.0, 2.0], "point": [3.0, 4.0]}, (2.4, 2.6), workers=1)
    dataset = family.to_xarray()
    assert dataset["over_period"].values.tolist() == [1.0, 2.0]
    assert dataset["period"].dims == ("point",)
    again = Family.load(family.save(tmp_path / "family.nc"))
    assert again.over["point"].tolist() == [3.0, 4.0]
    assert again == family


@pytest.mark.campaign
@pytest.mark.parametrize("name", guarding(["member", "failure", "count"], "member", campaign=0))
def test_a_parameter_along_branches_may_have_the_name_of_a_variable_too(name, tmp_path):
    system = systems.carried_map(("x",), {name: 2.5, "b": 1.0}, {"x": f"{name}*b*x*(1 - x)"})
    start = solve_orbit(system, {}, [("carry", "map", [0.6, 0.0], 1.0)])
    family = continue_family(start, name, {"b": [0.99, 1.0]}, (2.4, 2.6), workers=1)
    assert Family.load(family.save(tmp_path / "family.nc")) == family


def test_a_family_without_any_branch_is_saved_too(henon, tmp_path):
    family = continue_family(henon, "b", {"a": [-0.2, -0.3]}, (0.2, 0.4), workers=1)
    assert list(family) == [None, None]
    assert Family.load(family.save(tmp_path / "family.nc")) == family


def test_a_family_travels_between_processes(mixed):
    assert pickle.loads(pickle.dumps(mixed)) == mixed


def test_families_that_differ_in_one_point_are_not_equal(orbit, family):
    other = continue_family(orbit, "A", {"d": GAPS}, (0.05, 5.9), workers=1)
    assert other != family


# looks


def test_the_repr_lists_each_member_with_its_special_points_or_its_reason(mixed):
    lines = repr(mixed).splitlines()
    assert lines[0] == "Family of impact oscillator: 2 of 3 branches in A"
    assert lines[1].startswith("  d = 1, c = 0.1     ")
    assert lines[1].endswith(" orbits, A from 0.5 to 6; 1 PD")
    assert lines[2] == f"  d = 9, c = 0.1     none: {mixed.failures[1]}"


@pytest.mark.campaign
def test_the_repr_of_a_long_family_leaves_out_its_middle(henon):
    family = continue_family(henon, "b", {"a": np.linspace(0.2, 0.3, 40)}, (0.29, 0.31), workers=1)
    lines = repr(family).splitlines()
    assert len(lines) == 26
    assert lines[13] == "  ... 16 more ..."


def test_members_are_counted_and_indexed_from_both_ends(family):
    assert len(family) == len(GAPS)
    assert family[-1] is family.branches[3]
    with pytest.raises(ValueError, match="read-only"):
        family.over["d"][0] = 0.0


# input


def refuse(message):
    return pytest.raises(InputError, match=f"^{re.escape(message)}$")


@pytest.mark.parametrize("over", [None, {}, "d", [1.0, 2.0]])
def test_over_must_be_a_mapping(orbit, over):
    with refuse(f"over = {over!r}: must be a mapping of parameters to values, as {{'d': [0.9, 1.0, 1.1]}}"):
        continue_family(orbit, "A", over, BOUNDS)


@pytest.mark.parametrize(
    ("name", "hint"), [("dd", "; did you mean 'd'?"), ("A", "; 'A' varies along the branches"), ("Omega", "")]
)
def test_over_must_name_other_parameters(orbit, name, hint):
    with refuse(f"over = {name!r}: must be one of k, c, d, e, w{hint}"):
        continue_family(orbit, "A", {name: [1.0]}, BOUNDS)


@pytest.mark.parametrize("values", [[], 1.0, [[1.0, 2.0]], [[1.0], [1.0, 2.0]], ["a"], ["1.0"], [True], None, [None]])
def test_over_must_hold_numbers(orbit, values):
    with refuse(f"over['d'] = {values!r}: must be a sequence of numbers, one for each member, at least one"):
        continue_family(orbit, "A", {"d": values}, BOUNDS)


def test_over_must_hold_as_many_values_of_each(orbit):
    with refuse("over = '2 of d, 3 of c': must be as many values of each; member i has the i-th value of each"):
        continue_family(orbit, "A", {"d": [1.0, 2.0], "c": [0.1, 0.2, 0.3]}, BOUNDS)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_over_must_hold_finite_numbers(orbit, value):
    with refuse(f"d = {value!r}: must be a finite number"):
        continue_family(orbit, "A", {"d": [1.0, value]}, BOUNDS)


def test_values_must_be_those_that_the_system_allows(impact_oscillator):
    system = type(impact_oscillator).from_definition(
        impact_oscillator.definition() | {"positive": ["w"], "groups": {"both": ["k", "d"]}}
    )
    start = solve_orbit(system, {"w": 1.1}, [("free", "impact", [1.0, -1.3, 0.1], 5.71)])
    with refuse("w = -1.0: must be > 0"):
        continue_family(start, "A", {"w": [1.1, -1.0]}, BOUNDS)
    with refuse("over = 'both': must be without 'd', which 'd' sets already"):
        continue_family(start, "A", {"d": [1.0], "both": [1.0]}, BOUNDS)
    with refuse("over = 'both': must be one of c, d, e, w, A; 'k' varies along the branches"):
        continue_family(start, "k", {"both": [1.0]}, (0.9, 1.1))


@pytest.mark.parametrize("processes", [0, -1, 1.5, True, "all"])
def test_processes_must_be_a_count(orbit, processes):
    with refuse(f"workers = {processes!r}: must be an integer >= 1"):
        continue_family(orbit, "A", {"d": [1.0]}, BOUNDS, workers=processes)


def test_a_client_needs_no_processes_and_must_be_one(orbit):
    with refuse("workers = 2: must be left out where a client is given"):
        continue_family(orbit, "A", {"d": [1.0]}, BOUNDS, workers=2, client=object())
    with refuse("client = 'tcp://here:8786': must be a dask.distributed.Client"):
        continue_family(orbit, "A", {"d": [1.0]}, BOUNDS, client="tcp://here:8786")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"parameter": "AA"}, "parameter = 'AA': must be one of k, c, d, e, w, A; did you mean 'A'?"),
        ({"bounds": (2.0, 1.0)}, "bounds = (2.0, 1.0): must be two numbers, the lower first"),
        (
            {"options": BranchOptions(stop_at="XX")},
            "stop_at = 'XX': must be one of SN, PD, TR, BP, GR, CS, GS, SS, AS, BC, CH",
        ),
        ({"options": "up"}, "options = 'up': must be a BranchOptions"),
        ({"orbit": 3}, "orbit = 3: must be a PeriodicOrbit; find_orbit and solve_orbit give one"),
    ],
)
def test_what_continue_orbit_refuses_is_refused_before_any_member(orbit, options, message):
    given = {"orbit": orbit, "parameter": "A", "over": {"d": [1.0, 1.1]}, "bounds": BOUNDS} | options
    with refuse(message):
        continue_family(**given)


@pytest.mark.parametrize(
    ("index", "message"),
    [
        (4, "index = 4: must be an integer between -4 and 3"),
        ("A", "index = 'A': must be an integer between -4 and 3"),
        (True, "index = True: must be an integer between -4 and 3"),
    ],
)
def test_an_index_must_be_that_of_a_member(family, index, message):
    with refuse(message):
        family[index]
