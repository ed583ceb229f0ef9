"""A page: what a person does becomes steps, and what comes is shown."""

import pytest

from saltus.errors import SaltusError
from saltus.explorer.desk import Desk
from saltus.explorer.page import Page
from saltus.explorer.steps import Attract, Basin, FindEquilibrium, FindOrbit, Move, Place
from saltus.progress import Progress

pytestmark = pytest.mark.usefixtures("heard")


class Paper(Desk):
    """A desk that writes down what is wanted, without a process."""

    def __init__(self, application, session) -> None:
        super().__init__(application, session)
        self.wanted: list[tuple] = []
        self.filmed: list = []
        self.stops = self.kills = 0

    def start(self) -> None:
        """Start nothing."""

    def run(self, step, done=None, replaces="") -> None:
        self.wanted.append((step, done, replaces))

    def film(self, orbit, done) -> None:
        self.filmed.append((orbit, done))

    def stop(self) -> None:
        self.stops += 1

    def kill(self) -> None:
        self.kills += 1


def opened(session, toys, uploaded=lambda content: "0123456789ab") -> Page:
    """Return a page of a session."""
    return Page(Paper(toys, session), uploaded, lambda subject: "ba9876543210")


@pytest.fixture
def page(session, toys) -> Page:
    return opened(session, toys)


def test_the_first_solution_is_selected(page, session):
    assert session.settings.selected == Place(of="orbit1")
    assert "<th>beats</th>" in page.orbit._readings.object
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
        page.undo.clicks += 1
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


def test_basins_are_mapped_after_a_search_coarsely_then_finely(page, session):
    page._map({"z": (0.0, 2.0), "v": (-1.0, 4.0)}, {}, (50, 200))
    ((search, found, _),) = page.desk.wanted
    assert isinstance(search, Attract)
    assert search.parameters == {"a": 1.2}  # that of the selected orbit, as far as it is not the system's
    assert search.region == {"z": (0.0, 2.0), "v": (-1.0, 4.0)}
    found(session.add(search, session.results["orbit1"]))
    coarse, then, replaces = page.desk.wanted[-1]
    assert (coarse.grid, coarse.attractors, replaces) == (
        {"z": (0.0, 2.0, 50), "v": (-1.0, 4.0, 50)}, "attractors1", "",
    )  # fmt: skip
    then(session.add(coarse, session.results["orbit1"]))
    fine, last, replaces = page.desk.wanted[-1]
    assert (fine.grid["z"], replaces) == ((0.0, 2.0, 200), "basins1")
    last(session.entry("basins1"))
    assert len(page.desk.wanted) == 3
    page._map({"z": (0.0, 2.0), "v": (-1.0, 4.0)}, {}, (50, 200))
    assert isinstance(page.desk.wanted[-1][0], Basin)  # attractors of this region are known


def test_a_plane_needs_two_states(page):
    page._map({"z": (0.0, 2.0)}, {"v": 1.0}, (50, 200))
    assert "two different states" in page._message.object
    assert page.desk.wanted == []


def test_a_click_on_a_cell_runs_its_motion_in_place_of_the_last(page, session):
    page._follow_cell([0.5, 3.0])
    step, shown, replaces = page.desk.wanted[-1]
    assert step == Move(x0=(0.5, 3.0), periods=60)
    assert replaces == "motion1"
    page.orbit.tabs.active = 1
    shown(session.entry("motion1"))
    assert (page.orbit.tabs.active, session.settings.selected) == (0, Place(of="motion1"))


def test_a_motion_without_a_drive_runs_for_some_time(still, toys):
    page = opened(still, toys)
    page.select(Place(of="branch2", index=5))
    page._follow_cell([1.0, 1.0])
    assert page.desk.wanted[-1][0].t_end == pytest.approx(30.0 * still.results["branch2"].period[5])


def test_a_film_has_a_tab_of_its_own(page, session, tmp_path):
    page._film_wanted()
    ((orbit, filmed),) = page.desk.filmed
    assert orbit is session.results["orbit1"]
    path = tmp_path / "film.gif"
    path.write_bytes(b"GIF89a")
    for _ in range(2):
        filmed(path)
    assert page.orbit.tabs._names.count("Film") == 1
    assert page.orbit.tabs[page.orbit.tabs.active] is page._film


def test_work_is_stopped_and_at_a_second_click_ended(page):
    page.progressed("branch: saltus.continue_orbit(...)", Progress(3, 10, 1.0, "points"))
    assert page._stop.visible
    assert (page._bar.value, page._work.object) == (30, "branch 3 of 10 points")
    page._stop.clicks += 1
    assert (page._stop.name, page.desk.stops, page.desk.kills) == ("End now", 1, 0)
    page._stop.clicks += 1
    assert page.desk.kills == 1
    page.progressed("", None)
    assert (page._stop.name, page._stop.visible, page._work.object) == ("Stop", False, "")


def test_progress_without_an_end_is_told_without_a_share(page):
    page.progressed("orbit: x", Progress(7, None, 1.0))
    assert (page._bar.value, page._work.object.strip()) == (-1, "orbit 7")


def test_errors_are_written_as_text(page):
    page.told("<script>", error=True)
    assert (page._message.object, page._message.css_classes) == ("&lt;script&gt;", ["message", "error"])
    page.told("well")
    assert page._message.css_classes == ["message"]
    page.left()
    assert "another page" in page._message.object


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
