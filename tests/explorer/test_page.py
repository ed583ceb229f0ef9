"""A page: what a person does becomes steps, and what comes is shown."""

import json

import pytest
from bokeh.document import Document
from panel.io.state import set_curdoc

from saltus.errors import SaltusError
from saltus.explorer.desk import Desk, Work
from saltus.explorer.page import Page
from saltus.explorer.steps import FindEquilibrium, FindOrbit, Move, Place
from saltus.progress import Progress

pytestmark = pytest.mark.usefixtures("heard")


class Paper(Desk):
    """A desk that writes down what is wanted, without a process."""

    def __init__(self, application, session) -> None:
        super().__init__(application, session)
        self.wanted: list[tuple] = []
        self.filmed: list = []
        self.forms: list = []
        self.stops = self.kills = 0
        self.standing = Work()

    @property
    def busy(self) -> bool:
        return bool(self.standing.what)

    @property
    def work(self) -> Work:
        return self.standing

    def start(self) -> None:
        """Start nothing."""

    def run(self, step, done=None, replaces="") -> None:
        self.wanted.append((step, done, replaces))

    def film(self, orbit) -> None:
        self.filmed.append(orbit)

    def normal_forms(self, result, done, by) -> None:
        self.forms.append((result, done))

    def stop(self) -> None:
        self.stops += 1

    def kill(self) -> None:
        self.kills += 1


def opened(session, toys, uploaded=lambda content: "0123456789ab") -> Page:
    """Return a page of a session."""
    return Page(Paper(toys, session), uploaded, lambda subject: "ba9876543210")


def click(page: Page, button, kind: str) -> None:
    """Click on a button as the page's script does: it says the tag that the browser shows."""
    page.wishes.take([json.dumps([kind, button.tags[0]])])


@pytest.fixture
def page(session, toys) -> Page:
    return opened(session, toys)


def test_the_first_solution_is_selected(page, session):
    assert session.settings.selected == Place(of="orbit1")
    page.orbit.tabs.active = 2
    assert "<th>beats</th>" in page.orbit.later.made("Observables").panel.object
    assert page.actions._text.object == "orbit1 · stable"


def test_what_is_selected_is_named(page, session):
    first = session.results["branch1"].values[0]
    for place, told in {
        Place(of="branch1", index=0): f"branch1 point 0 · a = {first:.12g} · ",
        Place(of="branch1", label="SN1"): "branch1 SN1, saddle-node · a = 1.04719755",  # pi/3
    }.items():
        page.select(place)
        assert page.actions._text.object.startswith(told)
        assert page.orbit.title.object == page.actions._text.object


@pytest.mark.campaign
def test_an_empty_session_begins_with_an_orbit_or_an_equilibrium(empty, still, toys):
    driven = opened(empty, toys)
    driven.begin()
    assert [step for step, *_ in driven.desk.wanted] == [FindOrbit(x0=(0.0, 0.0))]
    still.entries.clear()
    still.settings.selected = None
    smooth = opened(still, toys)
    smooth.begin()
    assert [step for step, *_ in smooth.desk.wanted] == [FindEquilibrium(x0=(0.0, 0.0))]


def test_a_session_that_has_results_begins_with_nothing(page):
    page.begin()
    assert page.desk.wanted == []


@pytest.mark.campaign
def test_undo_drops_the_last_result_everywhere(page, session):
    assert not page.undo.disabled
    for name in ("motion1", "sweep1", "locus1", "branch1", "orbit1"):
        assert session.entries[-1].name == name
        click(page, page.undo, "undo")
    assert page.undo.disabled
    assert session.settings.selected is None
    assert "click on a branch" in page.orbit.title.object


@pytest.mark.campaign
def test_an_orbit_that_comes_is_selected_and_a_branch_is_not(page, session, taken_steps):
    steps, results = taken_steps
    page.added(session.add(steps["orbit1"], results["orbit1"]))
    assert session.settings.selected == Place(of="orbit2")
    page.added(session.add(steps["branch1"], results["branch1"]))
    assert session.settings.selected == Place(of="orbit2")
    assert len(page.list.panel) == len(session.entries) == 7


@pytest.mark.campaign
def test_a_locus_that_comes_sets_the_axes(page, session):
    page.added(session.entry("locus1"))
    assert page.diagram.axes == session.settings.axes == ("a", "e")


def test_the_script_is_kept_where_the_page_copies_it(page, session):
    assert page.diagram.figure.tags == [session.script()]
    session.settings.hidden.add("branch1")
    page._hidden_changed()
    assert page.diagram.figure.tags == [session.script()]
    assert "branch1.plot" not in session.script()


def test_a_sweep_observes_what_the_diagram_shows(page):
    seen = {}
    for name in ("max_z", "z", "e", "period", "mean(z)"):
        page.diagram.set_axes("a", name)
        seen[name] = page._observed()
    assert seen == {"max_z": ("max(z)",), "z": (), "e": (), "period": (), "mean(z)": ("mean(z)",)}


def test_a_plane_needs_two_states(page):
    page._map({"z": (0.0, 2.0)}, {"v": 1.0}, (50, 200))
    assert "two different states" in page._message.object
    assert page.desk.wanted == []


def test_a_click_on_a_cell_runs_its_motion_in_place_of_the_last(page, session):
    page._follow_cell([0.5, 3.0])
    step, _, replaces = page.desk.wanted[-1]
    assert step == Move(x0=(0.5, 3.0), periods=60)
    assert replaces == "motion1"
    page.orbit.tabs.active = 1
    page.added(session.entry("motion1"))
    assert (page.orbit.tabs.active, session.settings.selected) == (0, Place(of="motion1"))


def test_a_motion_without_a_drive_runs_for_some_time(still, toys):
    page = opened(still, toys)
    page.select(Place(of="branch2", index=5))
    page._follow_cell([1.0, 1.0])
    assert page.desk.wanted[-1][0].t_end == pytest.approx(30.0 * still.results["branch2"].period[5])


def test_a_film_has_a_tab_of_its_own(page, session, tmp_path):
    page._film_wanted()
    (orbit,) = page.desk.filmed
    assert orbit is session.results["orbit1"]
    path = tmp_path / "film.gif"
    path.write_bytes(b"GIF89a")
    for _ in range(2):
        page.filmed(path)
    assert page._tabs._names.count("Film") == 1
    assert page._tabs[page._tabs.active] is page._film
    assert page._film[0].object == b"GIF89a"
    assert page._film[0].width == 640  # that of the file: its texts are as large as they were drawn


def test_a_film_is_there_when_the_page_is_loaded_again(session, toys):
    (session.folder / "film.gif").write_bytes(b"GIF89a")
    again = opened(session, toys)
    assert again._tabs._names[-1] == "Film"
    assert again._film[0].object == b"GIF89a"


def test_work_is_stopped_and_at_a_second_click_ended(page):
    standing = Work("branch: saltus.continue_orbit(...)", Progress(3, 10, 1.0, "points"))
    page.desk.standing = standing
    page.worked(standing)
    assert page._stop.visible
    assert (page._bar.value, page._work.object) == (30, "branch 3 of 10 points, 7 s left")
    click(page, page._stop, "stop")
    assert (page.desk.stops, page.desk.kills) == (1, 0)
    page.desk.standing = standing._replace(stopping=True)
    click(page, page._stop, "stop")  # twice in a row, before the button says that it ends the process
    assert (page.desk.stops, page.desk.kills) == (1, 0)
    page.worked(page.desk.work)
    assert page._stop.name == "End now"
    click(page, page._stop, "stop")
    assert (page.desk.stops, page.desk.kills) == (1, 1)
    page.desk.standing = Work("sweep: saltus.run_sweep(...)")
    click(page, page._stop, "stop")  # the work has ended by itself meanwhile
    assert (page.desk.stops, page.desk.kills) == (1, 1)
    assert page._message.object == "nothing was ended: what was to be ended is done"
    page.worked(Work("sweep: saltus.run_sweep(...)"))
    assert (page._stop.name, page._stop.visible) == ("Stop", True)
    page.worked(Work())
    assert (page._stop.name, page._stop.visible, page._work.object) == ("Stop", False, "")


def test_a_page_that_comes_while_work_goes_on_shows_it(session, toys):
    desk = Paper(toys, session)
    desk.standing = Work("branch: saltus.continue_orbit(...)", Progress(7, None, 1.0))
    page = Page(desk, None, None)
    assert page._stop.visible
    assert (page._bar.value, page._work.object) == (-1, "branch 7")
    page.begin()
    assert desk.wanted == []


@pytest.mark.campaign
def test_two_pages_of_a_session_show_the_same(session, toys):
    desk = Paper(toys, session)
    first, second = Page(desk, None, None), Page(desk, None, None)
    first.diagram._axes[1].value = "max_z"
    assert second.diagram.axes == first.diagram.axes == ("g", "max_z")
    second.parameters._fields["a"]._number.value = 1.3
    assert first.parameters._fields["a"].value == first.parameters._fields["a"]._number.value == 1.3
    first.select(Place(of="branch1", label="SN1"))
    assert second.actions._text.object == first.actions._text.object != ""
    click(second, second.undo, "undo")
    assert len(first.list.panel) == len(second.list.panel) == len(session.entries) == 4


def test_errors_are_written_as_text(page):
    page.told("<script>", error=True)
    assert (page._message.object, page._message.css_classes) == ("&lt;script&gt;", ["message", "error"])
    page.told("well")
    assert page._message.css_classes == ["message"]


class Faulty(Paper):
    """A desk in which a fault of the package shows."""

    def run(self, step, done=None, replaces="") -> None:
        raise KeyError("<of>\nmore")


def test_a_fault_is_told_in_one_sentence_with_what_is_kept(session, toys, caplog):
    with set_curdoc(Document()):
        page = Page(Faulty(toys, session), None, None)
        for name in ("find-orbit", "sweep"):
            (button,) = page.starts.panel.select(
                lambda part, name=name: [name] == getattr(part, "css_classes", ()) and hasattr(part, "clicks")
            )
            page.told("")
            button.clicks += 1
            told = page._message.object
            assert told.startswith("KeyError: ")
            assert told.endswith("; this is a fault of saltus; kept: orbit1, branch1, locus1, sweep1, motion1")
            assert "\n" not in told
        page.wishes.source.data = {"wish": ["no JSON"], "at": ["1"]}
    assert page._message.object.startswith("JSONDecodeError: ")
    assert "Traceback" in caplog.text


@pytest.mark.campaign
def test_a_file_that_is_uploaded_is_opened_by_a_link(session, toys):
    def refused(content: bytes) -> str:
        raise SaltusError("no session")

    page = opened(session, toys)
    page._file.value = b"content"
    assert 'href="?session=0123456789ab"' in page._message.object
    other = opened(session, toys, refused)
    other._file.value = b"content"
    assert other._message.object == "no session"


@pytest.mark.campaign
def test_files_are_made_or_it_is_told_why_not(page, session):
    copy, python, netcdf, png, svg = page._downloads()
    assert copy.css_classes == ["copy-python"]
    assert python.callback().read().decode() == session.script()
    assert netcdf.callback().read()[1:4] == b"HDF"
    assert png.callback().read()[1:4] == b"PNG"
    session.settings.hidden |= {"branch1", "locus1", "sweep1"}
    assert svg.callback() is None
    assert "to draw" in page._message.object


def test_a_place_that_is_gone_is_told(page):
    page.select(Place(of="branch1", label="SN1"))
    page.session.settings.selected = Place(of="branch1", index=10**6)
    assert page._selected() is None
    assert page._message.object


def test_keys_and_tables_ask_for_places_and_steps(page, session):
    page.wishes.take(['["take", "branch1", "PD1"]'])
    assert session.settings.selected == Place(of="branch1", label="PD1")
    page.wishes.take(['["step", -1000000000, false]'])
    assert session.settings.selected == Place(of="branch1", index=0)
    page.wishes.take(['["step", 2, false]'])
    assert session.settings.selected == Place(of="branch1", index=2)
    page.wishes.take(['["take", "branch9", "PD1"]', '["close"]', '["name"]', '["sort", "x"]'])
    assert session.settings.selected == Place(of="branch1", index=2)
    session.settings.hidden.add("branch1")
    page.wishes.take(['["step", 1, false]'])
    assert session.settings.selected == Place(of="branch1", index=2)


def test_normal_forms_are_computed_once_the_table_is_seen(page, session):
    assert page.desk.forms == []
    page._tabs.active = 1
    results = {id(result) for result, _ in page.desk.forms}
    assert id(session.results["branch1"]) in results
    page.desk.forms[0][1]({"SN1": "nondegenerate"})
    assert "nondegenerate" in page.points._table.object


def test_axes_follow_what_is_left_after_undo(page, session, taken_steps):
    steps, results = taken_steps
    page.added(session.add(steps["branch1"], results["branch1"]))
    page.diagram.set_axes("e", "a")
    click(page, page.undo, "undo")
    assert page.diagram.axes == ("a", "z")  # of the sweep


def test_undo_drops_only_what_the_page_has_shown(page, session, taken_steps):
    seen = page.undo.tags[0]
    page.added(session.add(taken_steps[0]["branch1"], taken_steps[1]["branch1"]))
    page.wishes.take([json.dumps(["undo", seen])])
    assert session.last == "branch2"
    assert page._message.object.endswith("must be the last one; that is branch2 now")
    click(page, page.undo, "undo")
    assert session.last == seen


def test_an_empty_end_of_a_plane_is_told(page):
    for wrong in (float("nan"), float("-inf")):
        page._line("")
        page._map({"z": (wrong, 2.0), "v": (0.0, 1.0)}, {}, (50, 200))
        assert "an end of the range of z is empty" in page._message.object
    assert page.desk.wanted == []
