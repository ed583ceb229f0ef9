"""Fig. 4 of the paper: loci over frequency and drive, against branches along one parameter."""

from __future__ import annotations

import json
import os
import signal

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib.colors import to_hex
from mpl_toolkits.mplot3d import proj3d

import saltus
from saltus import afm
from saltus.afm.paper.figures import fig4, runner
from saltus.afm.paper.figures.files import read_results
from saltus.errors import InputError
from saltus.plotting import style
from saltus.plotting.space import stretches_of

pytestmark = pytest.mark.campaign  # the whole figure

LOCI = ["SN_1", "SN_2", "SN_3", "SN_left", "SN_touching", "SN_in_flight", "PD"]
A0 = 1.0 / 300.0


@pytest.fixture(scope="session")
def fig4_found(tmp_path_factory):
    said = []
    return runner("fig4")(tmp_path_factory.mktemp("fig4"), said.append) | {"said": said}


@pytest.fixture(scope="session")
def content(fig4_found):
    return json.loads(fig4_found["files"][1].read_text())


@pytest.fixture(scope="session")
def large():
    """An orbit of the saturated branch left of resonance, at a drive below that of period doublings."""
    guess = [
        ("flight", "touch", [-0.717, 0.7335], 2.95),
        ("contact", "release", [0.95, 0.85], 0.375),
        ("flight", "theta", [0.9, -0.4], 2.65),
    ]
    orbit = saltus.solve_orbit(afm.tapping_mode(afm.table1(), modes=1), {"Omega": 1.05}, guess)
    return _moved(_moved(orbit, "ybar", 0.12), "Omega", 0.92)


def _moved(orbit, name, value):
    """Return the orbit of the same branch at another value of a parameter, stable all the way."""
    begin = orbit.parameters[name]
    way = saltus.continue_orbit(
        orbit, name, (min(begin, value), max(begin, value)), directions="up" if value > begin else "down"
    )
    assert way.stable.all()
    end = way.solution(-1)
    assert end.parameters[name] == pytest.approx(value, abs=1e-12)
    return end


def test_four_files_are_written(fig4_found):
    assert [path.name for path in fig4_found["files"]] == ["fig4.nc", "fig4.json", "fig4.png", "fig4.pdf"]
    assert fig4_found["files"][2].read_bytes().startswith(b"\x89PNG")
    assert fig4_found["files"][3].read_bytes().startswith(b"%PDF")
    assert not fig4_found["interrupted"]
    assert fig4_found["said"][-1].text == "drawing"


def test_json_has_the_promised_form(content):
    assert set(content) == {"figure", "parameters", "pd_onset"}
    assert set(content["pd_onset"]) == {"ybar", "omega"}
    assert content["parameters"]["D_rep_1"] == 4.0
    assert content["parameters"]["ybar"] == [0.09, 0.15]


def test_period_doublings_begin_at_the_known_drive(content):
    """0.1251 with the parameters of Table 1; the paper prints 0.1252, with a modulus that it does not print."""
    assert content["pd_onset"]["ybar"] == pytest.approx(0.1251, abs=1e-4)


def test_the_onset_is_a_period_doubling_of_the_branch_in_the_drive(content, large):
    """At the onset's frequency the large orbit is stable up to the onset and doubles its period there."""
    onset = content["pd_onset"]
    branch = saltus.continue_orbit(_moved(large, "Omega", onset["omega"]), "ybar", (0.12, 0.13), directions="up")
    (doubling,) = branch.special_points.of_type("PD")
    assert doubling.parameters["ybar"] == pytest.approx(onset["ybar"], abs=1e-8)
    assert branch.stable[branch.values < onset["ybar"]].all()


@pytest.mark.parametrize(("beyond", "count"), [(-2e-5, 0), (2e-5, 2)])
def test_the_response_doubles_its_period_twice_above_the_onset_and_nowhere_below(content, large, beyond, count):
    """The doublings are some 1e-3 apart in frequency, and the steps much smaller."""
    onset = content["pd_onset"]
    orbit = _moved(large, "ybar", onset["ybar"] + beyond)
    response = saltus.continue_orbit(orbit, "Omega", (0.905, 0.925), steps=saltus.StepControl(largest=0.01))
    doublings = [p.parameters["Omega"] for p in response.special_points.of_type("PD")]
    assert len(doublings) == count
    assert all(abs(omega - onset["omega"]) < 1e-3 for omega in doublings)
    assert response.stable.all() == (count == 0)


def test_loci_pass_through_the_saddle_nodes_of_every_response(fig4_found):
    """The curves, as drawn, to a thousandth of the picture: less than a line's width."""
    results = fig4_found["results"]
    size = np.array([0.5, 0.06, 0.15])
    curves = [stretch.places for name in LOCI[:-1] for stretch in stretches_of(results[name], fig4._QUANTITIES)]
    drawn = np.concatenate(curves, axis=1).T / size
    for branch in (results["response"], *results["responses"]):
        drive = branch.parameters["ybar"]
        folds = branch.special_points.of_type("SN")
        assert len(folds) == 6
        for point in folds:
            place = np.array([point.parameters["Omega"], drive, point.orbit.min["z"]]) / size
            assert np.linalg.norm(drawn - place, axis=1).min() < 1e-3


def test_critical_multipliers_are_one_and_minus_one_all_along_the_loci(fig4_found):
    for name in LOCI:
        wanted = -1.0 if name == "PD" else 1.0
        multipliers = fig4_found["results"][name].multipliers
        assert np.abs(multipliers - wanted).min(axis=1).max() < 1e-5


@pytest.mark.thorough
def test_the_data_file_gives_every_result_back_under_its_name(fig4_found):
    again = read_results(fig4_found["files"][0])
    assert list(again) == ["response", "responses", *LOCI] == list(fig4_found["results"])
    assert {name: type(result).__name__ for name, result in again.items()} == dict.fromkeys(LOCI, "Locus") | {
        "response": "Branch",
        "responses": "Family",
    }
    for name, result in again.items():
        assert result == fig4_found["results"][name]


def test_a_group_of_the_data_file_is_a_result_on_its_own(fig4_found):
    import xarray as xr

    from saltus.continuation import Locus

    with xr.open_dataset(fig4_found["files"][0], group="PD", engine="h5netcdf") as dataset:
        assert Locus.from_xarray(dataset.load()) == fig4_found["results"]["PD"]


@pytest.mark.thorough
def test_a_file_without_groups_is_told(tmp_path, fig4_found):
    path = fig4_found["results"]["PD"].save(tmp_path / "one.nc")
    with pytest.raises(InputError, match="must be a figure's data file with groups"):
        read_results(path)
    (tmp_path / "text.nc").write_text("no data")
    with pytest.raises(InputError, match="must be a NetCDF file"):
        read_results(tmp_path / "text.nc")


@pytest.fixture(scope="session")
def space(fig4_found):
    figure = fig4.draw(fig4_found["results"])
    figure.canvas.draw()
    (ax,) = figure.axes
    return ax


def test_the_axes_are_frequency_drive_and_gap(space):
    assert space.name == "3d"
    for label, symbol in ((space.get_xlabel(), "Omega"), (space.get_ylabel(), "bar{y}"), (space.get_zlabel(), "min")):
        assert symbol in label


def test_only_stable_responses_are_drawn_and_the_loci_have_the_paper_s_colours(space):
    lines = [line for line in space.lines if line.get_linestyle() != "None"]
    assert {line.get_linestyle() for line in lines} == {"-"}
    colours = {to_hex(line.get_color()) for line in lines}
    assert colours == {style.CURVE, style.SPECIAL["SN"].colour, style.SPECIAL["PD"].colour}


def test_a_transparent_pink_plane_lies_where_contact_begins(space):
    (plane,) = space.collections
    red, green, blue, alpha = plane.get_facecolor()[0]
    assert red > blue > green
    assert 0.0 < alpha < 0.5
    (left, right), (front, back) = space.get_xlim(), space.get_ylim()
    corners = [(left, front, A0), (right, front, A0), (right, back, A0), (left, back, A0)]
    seen = np.array([proj3d.proj_transform(*corner, space.get_proj())[:2] for corner in corners])
    assert plane.get_paths()[0].vertices[:4] == pytest.approx(seen)


def test_the_legend_names_what_is_drawn_and_the_onset(space, content):
    (legend,) = space.figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert any(text.startswith("SN") for text in texts)
    assert any("stable" in text for text in texts)
    assert any(f"{content['pd_onset']['ybar']:.4f}" in text for text in texts)


@pytest.mark.parametrize(
    ("moment", "done", "kept"),
    [
        ("Omega = ", 60, ["response"]),
        ("responses: ", 3, ["response", "responses"]),
        ("SN_2: ", 20, ["response", "responses", "SN_1", "SN_2"]),
    ],
)
def test_an_interrupted_run_keeps_what_it_has(fig4_found, monkeypatch, tmp_path, moment, done, kept):
    """What the whole run has found already stands for the branches before those during which the interrupt comes."""
    for name in kept[:-1]:
        if name in ("response", "responses"):
            monkeypatch.setattr(fig4, name, lambda *_, name=name: fig4_found["results"][name])

    def say(progress):
        if progress.text.startswith(moment) and progress.done == done:
            os.kill(os.getpid(), signal.SIGINT)

    found = fig4.run(tmp_path, say)
    assert found["interrupted"]
    assert [path.name for path in found["files"]] == ["fig4.nc", "fig4.json"]
    assert list(read_results(tmp_path / "fig4.nc")) == kept
    content = json.loads((tmp_path / "fig4.json").read_text())
    assert content["pd_onset"] is None
    assert content["parameters"]["D_att_1"] == 0.025


def test_an_interrupt_before_the_first_result_is_passed_on(tmp_path):
    def say(progress):
        if progress.text == "correcting the first orbit":
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        fig4.run(tmp_path, say)
    assert not list(tmp_path.iterdir())
