"""Every input that a sweep refuses, by the text of its refusal."""

from __future__ import annotations

import numpy as np
import pytest

import systems
from grouped import Grouped
from mutated import logistic
from oracles.closed_forms import LOGISTIC
from saltus import HybridSystem, InputError, Mode, Section, run_sweep, simulate
from saltus.errors import SaltusError
from saltus.flow.poincare import iterate
from saltus.options import Criteria, SweepOptions

SHORT = {"discard": 1, "keep": 2}
swept = Grouped(run_sweep, options=SweepOptions)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], r"^values = \[\]: must be a sequence of numbers, at least one$"),
        ("many", r"^values = 'many': must be a sequence of numbers, at least one$"),
        ([[1.0, 2.0]], r"^values = \[\[1\.0, 2\.0\]\]: must be a sequence of numbers, at least one$"),
        ([1.0, np.nan], r"^values\[1\] = nan: must be finite$"),
        (
            [1.0, 3.0, 2.0],
            r"^values = '3, 2': must be ascending, each once; SweepOptions\(follow='down'\) goes from the last to the ",
        ),
        ([1.0, 1.0], r"^values = '1, 1': must be ascending, each once; "),
    ],
)
def test_values_that_cannot_be_followed(impact_oscillator, values, message):
    with pytest.raises(InputError, match=message):
        run_sweep(impact_oscillator, "A", values)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"discard": -1}, r"^SweepOptions.discard = -1: must be an integer >= 0$"),
        ({"keep": 0}, r"^SweepOptions.keep = 0: must be an integer >= 1$"),
        ({"keep": 2.5}, r"^SweepOptions.keep = 2\.5: must be an integer >= 1$"),
        (
            {"follow": "upp"},
            r"^SweepOptions.follow = 'upp': must be one of up, down, both, restart; did you mean 'up'\?$",
        ),
        ({"chunks": 3}, r"^SweepOptions.chunks = 3: must be an integer between 1 and 2, the number of values$"),
        ({"chunks": 2, "follow": "restart"}, r"^SweepOptions.chunks = 2: must be 1, as every value starts anew$"),
        ({"values": [0.5], "chunks": 2}, r"^SweepOptions.chunks = 2: must be 1, the number of values$"),
        ({"progress": "loud"}, r"^progress = 'loud': must be True for a bar, or a function of a saltus.Progress$"),
        (
            {"quantities": "v"},
            r"^SweepOptions.quantities = 'v': must be a sequence of texts, as \['v1'\], at least one; put it into a",
        ),
        (
            {"quantities": []},
            r"^SweepOptions.quantities = \[\]: must be a sequence of texts, as \['v1'\], at least one$",
        ),
        ({"quantities": ["x", "x"]}, r"^SweepOptions.quantities = 'x': must be named once$"),
        (
            {"quantities": ["x + vv"]},
            r"^expression = 'x \+ vv': must be in .* but 'vv' is unknown; did you mean 'v'\?$",
        ),
        ({"observables": ["maks(x)"]}, r"^observable = 'maks\(x\)': must be one of .*; did you mean 'max'\?$"),
        ({"exponents": 3}, r"^SweepOptions.exponents = 3: must be an integer between 1 and 2, the states$"),
        ({"criteria": {"longest": 4}}, r"^SweepOptions.criteria = \{'longest': 4\}: must be a Criteria$"),
        (
            {"section": "impakt"},
            r"^SweepOptions.section = 'impakt': must be one of the transitions impact, a Section, or None for ",
        ),
        (
            {"section": "x - 0.5"},
            r"^SweepOptions.section = 'x - 0\.5': must be one of .*; a surface of one's own is Section\('x - 0\.5'\)$",
        ),
        (
            {"section": Section("x - dd")},
            r"^expression = 'x - dd': must be in .* but 'dd' is unknown; did you mean 'd'",
        ),
        ({"tolerance": 1.0}, r"^SweepOptions.tolerance = 1\.0: must be a number between 1e-14 and 0\.1$"),
        ({"parameters": {"e": "much"}}, r"^e = 'much': must be a finite number$"),
        (
            {"x0": [0.0]},
            r"^x0 = \[0\.0\]: must be of shape \(2,\), one number for each of x, v, or \(3,\) with",
        ),
        ({"mode": "fre"}, r"^SweepOptions.mode = 'fre': must be one of free; did you mean 'free'\?$"),
        ({"workers": 0}, r"^SweepOptions.workers = 0: must be an integer >= 1$"),
        ({"client": "here"}, r"^SweepOptions.client = 'here': must be a dask\.distributed\.Client$"),
        ({"client": "here", "workers": 2}, r"^SweepOptions.workers = 2: must be left out where a client is given$"),
        ({"path": "nowhere/a.nc"}, r"^path = 'nowhere/a\.nc': must be in a folder that exists and can be written$"),
    ],
)
def test_an_option_that_cannot_be_used(impact_oscillator, options, message):
    with pytest.raises(InputError, match=message):
        swept(impact_oscillator, "A", **{"values": [0.5, 0.6]} | SHORT | options)


def test_a_file_that_is_a_folder(impact_oscillator, tmp_path):
    with pytest.raises(InputError, match=r"^path = .*: must be a file that exists; it is a folder$"):
        run_sweep(impact_oscillator, "A", [0.5], path=tmp_path, options=SweepOptions(**SHORT))


def test_a_harmonic_of_a_part_of_a_motion_without_a_phase():
    system = systems.carried_map(("x",), {"a": 3.2}, LOGISTIC)
    with pytest.raises(
        InputError, match=r"^observable = 'amplitude\(x, 1/2\)': must be of a whole order for a system without a phase$"
    ):
        run_sweep(system, "a", [3.2], options=SweepOptions(section="map", observables=["amplitude(x, 1/2)"], **SHORT))


def test_a_parameter_of_another_name(impact_oscillator):
    with pytest.raises(InputError, match=r"^parameter = 'omega': must be one of k, c, d, e, w, A$"):
        run_sweep(impact_oscillator, "omega", [1.0])


def test_a_value_that_the_parameter_must_not_have(ball):
    with pytest.raises(InputError, match=r"^g = -1\.0: must be > 0$"):
        run_sweep(ball, "g", [-1.0, 1.0], options=SweepOptions(section="impact"))


def test_a_system_without_a_phase_needs_a_section():
    system = systems.carried_map(("x",), {"a": 3.2}, LOGISTIC)
    told = (
        r"^SweepOptions.section = None: must be the name of a transition, map, or a Section; the system has no phase: "
        r"as section='map' or section=saltus.Section\('x - 0.5', direction=1\)$"
    )
    with pytest.raises(InputError, match=told):
        run_sweep(system, "a", [3.2])
    with pytest.raises(InputError, match=r"^section = None: must be a transition for a system without a phase$"):
        iterate(system, system.parameter_vector({}), [0.3, 0.0], 0, discard=0, keep=1)


def test_a_start_must_be_given_where_no_mode_holds_at_zero(relay):
    definition = relay.definition()
    for mode in definition["modes"].values():
        mode["domain"] = "x1 - 1"
    system = type(relay).from_definition(definition)
    with pytest.raises(InputError, match=r"^x0 = None: must be given for this system: no mode holds where all states"):
        run_sweep(system, "gain", [1.0], options=SweepOptions(section="switch_up"))


def test_a_start_outside_the_domain_of_its_mode_at_every_value():
    system = HybridSystem(("x",), {"b": 0.0}, {"low": Mode({"x": "-x"}, domain="x - 2 + b")}, phase=("s", "1"))
    message = r"^x0 = \[0\.0, 0\.0\]: must be in the domain of mode 'low', x - 2 \+ b > 0; it is -1 there"
    with pytest.raises(InputError, match=message + "; at b = 1, and no other value admits the start$"):
        run_sweep(system, "b", [1.0, 1.5], x0=[0.0], options=SweepOptions(mode="low", **SHORT))
    with pytest.raises(InputError, match=message + "$"):
        simulate(system, {"b": 1.0}, [0.0], mode="low", periods=1)


def test_a_section_with_a_direction_that_is_none():
    with pytest.raises(InputError, match=r"^direction = 2: must be -1 \(falling\), 0 \(either\) or 1 \(rising\)$"):
        Section("x", direction=2)


CHANGES = {
    "discard": {"discard": 2},
    "keep": {"keep": 3},
    "values": {"values": [0.5, 0.7]},
    "parameters": {"parameters": {"e": 0.7}},
    "quantities": {"quantities": ["v"]},
    "x0": {"x0": [0.1, 0.0]},
    "criteria": {"criteria": Criteria(longest=4)},
    "follow": {"follow": "down"},
    "section": {"section": "impact"},
    "rtol": {"tolerance": 1e-9},
}


@pytest.fixture(scope="module")
def own(impact_oscillator, tmp_path_factory):
    """The options of a sweep whose file is written."""
    options = {"values": [0.5, 0.6], "path": tmp_path_factory.mktemp("swept") / "a.nc"} | SHORT
    swept(impact_oscillator, "A", **options)
    return options


@pytest.mark.parametrize("name", CHANGES)
def test_a_file_of_other_input_is_refused_by_the_name_of_what_differs(impact_oscillator, own, name):
    with pytest.raises(InputError, match=rf"^path = .*: must be the file of a sweep of the same input; its {name} is "):
        swept(impact_oscillator, "A", **own | CHANGES[name])


@pytest.mark.campaign
def test_a_file_of_another_system_or_kind_is_refused(impact_oscillator, ball_on_table, tmp_path):
    path = tmp_path / "a.nc"
    run_sweep(impact_oscillator, "w", [1.0], path=path, options=SweepOptions(**SHORT))
    with pytest.raises(InputError, match=r"; its system is \{'name': 'impact oscillator'"):
        run_sweep(ball_on_table, "w", [1.0], x0=[2.0, 0.0], path=path, options=SweepOptions(**SHORT))
    path.write_text("something else")
    with pytest.raises(InputError, match=r"^path = .*: must be a NetCDF file"):
        run_sweep(impact_oscillator, "w", [1.0], path=path, options=SweepOptions(**SHORT))


@pytest.fixture(scope="module")
def sweep(impact_oscillator):
    return run_sweep(impact_oscillator, "A", [0.5, 0.6], options=SweepOptions(observables=["max(x)"], **SHORT))


def test_a_value_outside_the_sweep(sweep):
    with pytest.raises(InputError, match=r"^value = 0\.7: must be between 0\.5 and 0\.6$"):
        sweep.at(0.7)
    with pytest.raises(InputError, match=r"^value = 'a': must be between 0\.5 and 0\.6$"):
        sweep.at("a")


def test_a_direction_that_was_not_followed(sweep):
    with pytest.raises(InputError, match=r"^direction = 'down': must be one of up$"):
        sweep.at(0.5, "down")


def test_a_value_that_was_not_computed(impact_oscillator):
    def interrupt(*told):
        raise KeyboardInterrupt

    part = run_sweep(impact_oscillator, "A", [0.5, 0.6], progress=interrupt, options=SweepOptions(**SHORT))
    with pytest.raises(InputError, match=r"^value = 0\.6: must be one that was computed; interrupted: 1 of 2 values "):
        part.at(0.6)


def test_a_quantity_that_was_not_kept(sweep):
    with pytest.raises(
        InputError, match=r"^quantity = 'max\(v\)': must be one of x, v, max\(x\); did you mean 'max\(x\)'"
    ):
        sweep.column("max(v)")


def test_threads_that_the_system_refuses_are_told_and_one_needs_none(monkeypatch):
    carried = logistic()
    options = {"section": "map", "chunks": 2, **SHORT}
    assert run_sweep(carried, "r", [2.9, 3.2], x0=[0.3, 0.0], options=SweepOptions(workers=1, **options)).done.all()

    def refuse(thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("threading.Thread.start", refuse)
    with pytest.raises(
        SaltusError, match=r"allows no further thread or process .*: allow more, or SweepOptions\(workers=1\)$"
    ):
        run_sweep(carried, "r", [2.9, 3.2], x0=[0.3, 0.0], options=SweepOptions(workers=2, **options))
    assert run_sweep(carried, "r", [2.9, 3.2], x0=[0.3, 0.0], options=SweepOptions(workers=1, **options)).done.all()
