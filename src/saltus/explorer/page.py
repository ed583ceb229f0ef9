"""One page: the views of a session, and what happens when a person does something."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus.errors import InputError, SaltusError
from saltus.explorer import widgets
from saltus.explorer.basin_search import Search, map_plane
from saltus.explorer.desk import FILM, Desk, Listener, Work
from saltus.explorer.kinds import kind_of, motion_step
from saltus.explorer.lines import line_of, share_of, title_of
from saltus.explorer.live import Live
from saltus.explorer.numerics import with_numerics
from saltus.explorer.parameter_view import ParameterView
from saltus.explorer.picture import picture_of
from saltus.explorer.plane_view import colour_of_motion
from saltus.explorer.points.stepping import stepped
from saltus.explorer.points.view import PointView
from saltus.explorer.points.wishes import Wishes
from saltus.explorer.solutions import observable_of, traits_of
from saltus.explorer.steps import Basin, Place, Step, taken
from saltus.explorer.views.action_view import ActionView, StartView
from saltus.explorer.views.basin_view import BasinView
from saltus.explorer.views.diagram_view import DiagramView
from saltus.explorer.views.diagrams_view import DiagramsView
from saltus.explorer.views.equations_view import EquationsView
from saltus.explorer.views.list_view import ListView
from saltus.explorer.views.numerics_view import NumericsView
from saltus.explorer.views.orbit_view import OrbitView
from saltus.explorer.views.session_view import link
from saltus.explorer.views.space_view import SpaceView

if TYPE_CHECKING:
    from saltus.explorer.session import Entry
    from saltus.explorer.subjects import Subject

__all__ = ["Page"]

_STOP = "Stop"  # what the button says before it was pressed
_END = "End now"  # and after
_PLANE = 2  # states of a plane of basins
_BASINS = "Basins"  # name on a tab
_SPACE = "3-D"  # likewise
_LIVE_PACE = 8  # milliseconds between two looks for what is drawn while a slider moves


class Page(Listener):
    """A page.

    Parameters
    ----------
    desk : Desk
        The session and its process.
    uploaded : callable
        Called with the content of a session's file; it returns the name of this session.
    defined : callable
        Called with a `Subject`; it returns the name of a new session of it.
    """

    def __init__(self, desk: Desk, uploaded: Callable[[bytes], str], defined: Callable[[Subject], str]) -> None:
        self.desk, self.session = desk, desk.session
        widgets.tell_faults(self._fault)
        self._live_watch: Any = None
        self._message, self._work, self._bar = widgets.html("message"), widgets.html("work"), widgets.bar()
        self._stop = widgets.button(_STOP, "stop", kind="danger", tip="what is done is kept")
        self._stop.visible = False
        widgets.on_seen_click(self._stop, "stop")
        self.diagram = DiagramView(self.session, self.select, self._line, self._settings_changed)
        self.diagrams = DiagramsView(self.session, self.diagram, self.select, self._line, self._settings_changed)
        self.orbit = OrbitView(self.session, self._line, desk.application.readings, self._simulate)
        self.plane = self.orbit.plane
        self.live = Live(self.plane.show_frame)
        self._later = self.orbit.later
        if len(self.session.system.states) >= _PLANE:
            self._later.add(_BASINS, self._basin_view)
        self._later.add(_SPACE, lambda: SpaceView(self.session, self.diagram.colour), SpaceView.redraw)
        self._later.add("Equations", lambda: EquationsView(self.session, defined))
        self.parameters = ParameterView(self.session, self._values_changed, self._slides, self._line)
        self.numerics = NumericsView(self.session, self._settings_changed, self._line)
        self.starts = StartView(self.session, self.run, self._observed, self._line)
        self.actions = ActionView(self.session, self.run, self._film_wanted, desk.application.films, self._line)
        self.list = ListView(self.session, self._hidden_changed)
        self.points = PointView(self.session, self._forms_wanted)
        self._film = widgets.film()
        self._tabs = widgets.tabs(**{"Results": self.list.panel, "Special points": self.points.panel})
        widgets.on_change(self._tabs, lambda active: self.points.seen() if active == 1 else None, "active")
        settled, self.wishes = widgets.settler(), Wishes(self.diagram.figure)
        self.wishes.on("leave", lambda mark: settled(lambda: self.wishes.answer(mark)))
        for kind, work in self._works().items():
            self.wishes.on(kind, work)
        self._file = widgets.upload("open-session")
        widgets.on_change(self._file, lambda content: self._open(content, uploaded))
        self.undo = widgets.button("Undo", "undo", tip="drop the last result")
        widgets.on_seen_click(self.undo, "undo")
        desk.join(self, widgets.poster())
        if self.session.settings.selected is None:
            first = next((e for e in self.session.entries if e.step.noun in ("orbit", "equilibrium")), None)
            self.session.settings.selected = None if first is None else Place(of=first.name)
        self._show_all()
        if (film := self.session.folder / FILM).is_file():
            self._put_film(film)
        self.worked(desk.work)

    # ---- parts of the page ----

    def parts(self) -> dict[str, Any]:
        """Return the parts of the page by the name of their place."""
        return {
            "tools": widgets.row(self.undo, *self._downloads(), wrap=True),
            "controls": widgets.column(
                self.starts.panel,
                self.parameters.panel,
                self.numerics.panel,
                widgets.html("heading", "<h2>Open a session</h2>", (8, 8, 0, 8)),
                self._file,
            ),
            "diagram": self.diagrams.panel,
            "results": widgets.column(self.actions.panel, self._tabs),
            "orbit": self.orbit.panel,
            "status": widgets.row(self._stop, self._bar, self._work, self._message, wrap=True),
        }

    def _downloads(self) -> list[Any]:
        files = {
            ("Python", "session.py"): lambda: BytesIO(self.session.script().encode()),
            ("NetCDF", "session.nc"): self._packed,
            ("PNG", "diagram.png"): lambda: picture_of(self.session, "png"),
            ("SVG", "diagram.svg"): lambda: picture_of(self.session, "svg"),
        }
        made = [widgets.download(label, name, self._careful(content)) for (label, name), content in files.items()]
        copy = widgets.button("Copy as Python", "copy-python", tip="a script that makes what is shown")
        return [copy, *made]

    def _careful(self, content: Callable[[], BytesIO]) -> Callable[[], BytesIO | None]:
        """Return a function that tells an error in the page where a file cannot be made."""

        def made() -> BytesIO | None:
            try:
                return content()
            except SaltusError as error:
                self._line(str(error))
                return None

        return made

    def _packed(self) -> BytesIO:
        return BytesIO(self.session.packed(self.session.folder / "session.nc").read_bytes())

    # ---- what a person does ----

    def run(self, step: Step, done: Callable[[Entry], None] | None = None, replaces: str = "") -> None:
        """Take a step in the companion process."""
        self._line("")
        try:
            step = with_numerics(step, self.session.settings.numerics, self.session.system)
        except SaltusError as error:
            self._line(str(error))
            return
        self.desk.run(step, done, replaces)

    def _stop_clicked(self, seen: str) -> None:
        """Interrupt the work; where the button said that it ends the process, end it, unless the work is done."""
        stopping = self.desk.work.stopping
        if seen == _END and stopping:
            self.desk.kill()
        elif seen == _END:
            self._line("nothing was ended: what was to be ended is done")
        elif not stopping:
            self.desk.stop()

    def _open(self, content: bytes | None, uploaded: Callable[[bytes], str]) -> None:
        if content:
            try:
                where = uploaded(content)
                self._line("")
                self._message.object = f"The session is read: {link({'session': where}, 'open it')}"
            except SaltusError as error:
                self._line(str(error))

    def select(self, place: Place) -> None:
        """Show a solution at the right side, and what can be done with it."""
        self.session.settings.selected = place
        self.diagrams.mark_chosen()
        self._show_selected()
        self.points.show()
        self.desk.change(self)

    def _works(self) -> dict[str, Callable[..., None]]:
        """Return what keys, and buttons in tables and lists, ask for."""
        return {
            "take": lambda of, label: self._take(Place(of=of, label=label)),
            "close": self.diagrams.close_lists,
            "name": self.diagram.name_marks_anew,
            "sort": self.points.sort,
            "step": lambda count, special: self._step(int(count), special=bool(special)),
            "refused": lambda name, text, allowed: self._line(str(InputError(name, text, allowed))),
            "undo": self._undo,
            "stop": self._stop_clicked,
        }

    def _take(self, place: Place) -> None:
        self.diagrams.close_lists()
        if place.of in self.session.results:
            self.select(place)

    def _step(self, count: int, *, special: bool) -> None:
        """Go along the branch on which the selected solution is."""
        hidden = self.session.settings.hidden
        seen = {name: result for name, result in self.session.results.items() if name not in hidden}
        place = stepped(self.session.settings.selected, count, seen, special=special)
        if place is not None and place != self.session.settings.selected:
            self._take(place)

    def _forms_wanted(self, name: str, done: Callable[[dict[str, str]], None]) -> None:
        self.desk.normal_forms(self.session.results[name], done, self)

    def _undo(self, seen: str) -> None:
        """Drop the last result, if it is the one that the page showed as the last."""
        try:
            self.desk.undo(seen)
        except SaltusError as error:
            self._line(str(error))
            return
        self.points.forget_gone()
        self.diagram.follow_newest()
        self._show_all()
        self.desk.change(self)

    def _settings_changed(self) -> None:
        self.session.keep()
        self._tell_script()
        self.desk.change(self)

    def _values_changed(self) -> None:
        """Take in values that were changed, and draw what follows at once."""
        self._settings_changed()
        self.plane.values_are(self.session.settings.parameters)
        self._slides(self.session.settings.parameters)

    def _slides(self, parameters: dict[str, float]) -> None:
        """Draw the motion from the start, and the orbit that is carried along, at values that a slider passes."""
        if self.plane.live:
            self.live.want(self.plane.wish(parameters))
            self._attend_live()

    def _ready(self) -> None:
        """Start the process that draws while a slider moves, before one does."""
        if self.plane.live and self.session.entries:
            self.live.want(self.plane.wish(self.session.settings.parameters, shown=False))
            self._attend_live()

    def _attend_live(self) -> None:
        import panel as pn

        document = pn.state.curdoc
        if self._live_watch is None and self.live.busy and document is not None:
            self._live_watch = document.add_periodic_callback(widgets.guarded(self._look_live), _LIVE_PACE)

    def _look_live(self) -> None:
        self.live.listen()
        if not self.live.busy and self._live_watch is not None:
            self.diagram.figure.document.remove_periodic_callback(self._live_watch)
            self._live_watch = None

    def _simulate(self, x0: tuple[float, ...], span: float) -> None:
        """Simulate the motion from a start, and keep it."""
        settings = self.session.settings
        if x0 != settings.x0:
            settings.x0, settings.mode = x0, None
            self.parameters.show()
        self.run(motion_step(self.session.system, self.session.changed(), x0, settings.mode, span))

    def _hidden_changed(self) -> None:
        self.diagrams.redraw()
        self._later.redraw(_SPACE)
        self.plane.draw()
        self._settings_changed()

    def _observed(self) -> tuple[str, ...]:
        """Return what a sweep should observe, so that it can be drawn on the diagram's axes."""
        told, system = observable_of(self.diagram.axes[1], self.session.system), self.session.system
        return () if told in system.states or told in system.parameter_names or told == "period" else (told,)

    def _map(self, free: dict[str, tuple[float, float]], frozen: dict[str, float], counts: tuple[int, int]) -> None:
        """Find attractors about the plane, then map it coarsely, then finely."""
        if len(free) < 2:
            self._line("a plane needs two different states")
            return
        if wrong := [name for name, ends in free.items() if not all(map(isfinite, ends))]:
            self._line(f"an end of the range of {wrong[0]} is empty or infinite: it must be a finite number")
            return
        solution, view = self._selected(), self._later.made(_BASINS)
        given = self.session.changed() if solution is None else dict(solution.parameters)
        search = Search(given, view.region(free), view.interval)
        self._line("")
        map_plane(self.desk, search, free, frozen, counts)

    def _follow_cell(self, x0: list[float]) -> None:
        """Run the motion from a start, for some periods."""
        basins = [entry for entry in self.session.entries if entry.step.noun == "basins"]
        parameters = dict(basins[-1].step.parameters) if basins and isinstance(basins[-1].step, Basin) else {}
        system = self.session.system
        span = kind_of(system).span_of_cell(self._selected())
        step = motion_step(system, parameters, tuple(x0), None, span)
        before = [entry.name for entry in self.session.entries if entry.step.noun == "motion"]
        self.run(step, None, before[-1] if before else "")

    def _film_wanted(self) -> None:
        self.desk.film(self._selected())

    # ---- what the desk tells ----

    def filmed(self, path: Path) -> None:
        """Show a film that has come."""
        self._put_film(path)
        self._tabs.active = [*self._tabs].index(self._film)

    def _put_film(self, path: Path) -> None:
        self._film[0].object = path.read_bytes()
        if self._film not in [*self._tabs]:
            self._tabs.append(("Film", self._film))

    def added(self, entry: Entry) -> None:
        """Show a result that has come."""
        self.diagram.follow(entry.result)
        if entry.step.noun in ("orbit", "equilibrium", "motion"):
            self.session.settings.selected = Place(of=entry.name)
        if entry.step.noun == "motion":
            self.orbit.tabs.active = 0
        self._show_all()
        if len(self.session.entries) == 1:
            self._ready()

    def changed(self) -> None:
        """Show what another page has changed."""
        self.diagram.set_axes(*self.session.settings.axes)
        self.points.forget_gone()
        self.parameters.show()
        self.numerics.show()
        self.plane.values_are(self.session.settings.parameters)
        self._show_all()

    def worked(self, work: Work) -> None:
        """Show how far the work has come."""
        self._stop.visible = self._bar.visible = bool(work.what)
        self._stop.name = _END if work.stopping else _STOP
        self._stop.tags = [self._stop.name]
        self._bar.value = share_of(work.progress)
        self._work.object = line_of(work)
        self.diagram.draw_trail(work.trail)

    def told(self, line: str, *, error: bool = False) -> None:
        """Show a line."""
        self._message.css_classes = ["message", "error"] if error else ["message"]
        self._message.object = escape(line)

    def close(self) -> None:
        """End the process that draws."""
        self.live.close()

    def _fault(self, error: Exception) -> None:
        """Tell an error that nobody has expected."""
        if isinstance(error, SaltusError):
            self._line(str(error))
            return
        first = str(error).partition("\n")[0]
        self._line(f"{type(error).__name__}: {first}; this is a fault of saltus; {self.desk.kept}")

    def _line(self, line: str) -> None:
        self.told(line, error=bool(line))

    # ---- showing ----

    def _selected(self) -> Any:
        place = self.session.settings.selected
        try:
            return None if place is None else taken(place, self.session.results)
        except SaltusError as error:
            self._line(str(error))
            return None

    def _show_all(self) -> None:
        self.diagrams.redraw()
        self._later.redraw(_SPACE)
        self.list.show(self._colour, self.diagram.unseen)
        self.undo.disabled, self.undo.tags = not self.session.entries, [self.session.last]  # at once: as the list says
        self.points.show()
        self._show_selected()
        self._tell_script()
        if (view := self._later.made(_BASINS)) is not None:
            self._show_basins(view)

    def _basin_view(self) -> BasinView:
        made, solution = BasinView(self.session, self._map, self._follow_cell), self._selected()
        if traits_of(solution).what:
            made.solution_is(solution)
        self._show_basins(made)
        return made

    def _show_basins(self, view: BasinView) -> None:
        basins: list[Any] = [entry.result for entry in self.session.entries if entry.step.noun == "basins"]
        if basins:
            view.show(basins[-1])

    def _colour(self, number: int) -> str:
        entry = self.session.entries[number]
        moves = entry.step.noun == "motion"
        return colour_of_motion(self.session, entry.name) if moves else self.diagram.colour(number)

    def _tell_script(self) -> None:
        self.diagram.figure.tags = [self.session.script()]  # from where the page's script copies it

    def _show_selected(self) -> None:
        place, solution = self.session.settings.selected, self._selected()
        told = "" if place is None or solution is None else title_of(place, self.session.results, solution)
        self.orbit.show(solution, told)
        self.live.start_from(solution)
        self.actions.show(told)
        view = self._later.made(_BASINS)
        if view is not None and traits_of(solution).what:
            view.solution_is(solution)

    def begin(self) -> None:
        """Find a first orbit where a session has nothing yet; of a smooth autonomous system an equilibrium."""
        if not self.session.entries and not self.desk.busy:
            settings, find = self.session.settings, kind_of(self.session.system).first
            self.run(find(parameters=self.session.changed(), x0=settings.x0, mode=settings.mode))
        self._ready()
