"""The selected solution: its curves, its multipliers, its numbers, and errors in words."""

import numpy as np
import pytest

from saltus.explorer import solutions
from saltus.explorer.figures.spectrum_view import SpectrumView
from saltus.explorer.views.orbit_view import OrbitView

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def lines() -> list[str]:
    return []


def viewed(session, lines, toys, name: str = "") -> OrbitView:
    """Return the view of a result."""
    made = OrbitView(session, lines.append, toys.readings, lambda x0, span: None)
    if name:
        made.show(session.results[name], f"<b>{name}</b>")
    return made


def spectrum_of(view: OrbitView) -> SpectrumView:
    """Return the multipliers of a view, which a person looks at."""
    view.tabs.active = 1
    return view.later.made("Multipliers")


def readings_of(view: OrbitView) -> str:
    """Return the table of observables of a view, at which a person looks."""
    view.tabs.active = 2
    return view.later.made("Observables").panel.object


def test_nothing_is_shown_where_nothing_is_selected(session, lines, toys):
    view = viewed(session, lines, toys)
    assert "click on a branch" in view.title.object
    assert view._sources["portrait"][0].data["xs"] == []
    spectrum = spectrum_of(view)
    assert (spectrum.values.data["x"], spectrum.numbers.object, readings_of(view)) == ([], "", "")


def test_an_orbit_has_a_portrait_and_a_series(session, lines, toys):
    view = viewed(session, lines, toys, "orbit1")
    orbit = session.results["orbit1"]
    curves, events, vertices = view._sources["series"]
    assert curves.data["mode"] == ["flight"] * len(curves.data["xs"])
    assert max(max(xs) for xs in curves.data["xs"]) == pytest.approx(orbit.period)
    assert len(events.data["x"]) == 1
    assert vertices.data["tip"] == ["flight"] * sum(map(len, curves.data["xs"]))
    heights = np.concatenate(view._sources["portrait"][0].data["xs"])
    assert heights.max() == pytest.approx(orbit.max["z"], rel=1e-3)  # at 400 points
    assert view._portrait.x_range.start < heights.min() < heights.max() < view._portrait.x_range.end
    assert lines == []


def test_an_equilibrium_has_a_portrait_of_motions_about_it(still, lines, toys):
    view = viewed(still, lines, toys, "equilibrium1")
    curves, places, _ = view._sources["portrait"]
    assert (places.data["x"], places.data["y"]) == (pytest.approx([1.0]), pytest.approx([1.5]))
    assert len(curves.data["xs"]) > 1
    assert view._portrait.x_range.start < 0.95 < 1.05 < view._portrait.x_range.end
    assert view._near.visible
    assert spectrum_of(view).figure.title.text == "Eigenvalues"
    assert len(spectrum_of(view).values.data["x"]) == 2
    view.show(still.results["branch2"].solution(5), "")
    assert not view._near.visible
    view._axes[1].value = "x*y"
    view.show(still.results["equilibrium1"], "")
    assert "quantity = 'x*y': must be one of t, x, y for an equilibrium" in lines[-1]


def test_a_motion_has_no_multipliers(session, lines, toys):
    view = viewed(session, lines, toys, "motion1")
    assert spectrum_of(view).values.data["x"] == []
    assert spectrum_of(view).figure.title.text == ""
    assert "z at the end" in readings_of(view)
    assert len(view._sources["series"][1].data["x"]) == np.sum(session.results["motion1"].events["kind"] == "event")


def test_an_instrument_shows_an_orbit(session, lines, toys):
    assert "<th>beats</th><td>0.159154943</td>" in readings_of(viewed(session, lines, toys, "orbit1"))


def test_other_quantities_are_drawn_and_kept(session, lines, toys):
    view = viewed(session, lines, toys, "orbit1")
    view._axes[2].value = "z**2"
    assert session.settings.planes == ("z", "v", "z**2")
    squares = np.concatenate(view._sources["series"][0].data["ys"])
    heights = np.concatenate(view._sources["portrait"][0].data["xs"])
    assert squares == pytest.approx(heights**2)
    assert view._series.yaxis.axis_label == "z**2"
    assert (session.folder / "session.json").is_file()


def test_a_wrong_quantity_is_told_and_draws_nothing(session, lines, toys):
    view = viewed(session, lines, toys, "orbit1")
    view._axes[0].value = "__import__('os')"
    assert any("__import__" in line for line in lines)
    assert view._sources["portrait"][0].data["xs"] == []
    assert view._sources["series"][0].data["xs"] != []


def test_a_motion_of_too_many_steps_is_told_and_not_drawn(session, lines, toys, monkeypatch):
    monkeypatch.setattr(solutions, "_MOST_STEPS", 5)
    view = viewed(session, lines, toys, "motion1")
    assert view._sources["portrait"][0].data["xs"] == []
    steps = len(session.results["motion1"].step_times)
    told = f"motion = '{steps} steps': must be of at most 5 steps to be drawn; it is kept"
    assert lines == [told, told]  # of the portrait and of the series
    assert "events" in readings_of(view)
