"""The buttons of a page: what starts anew, and what the selected solution allows."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from saltus.errors import InputError
from saltus.explorer import widgets
from saltus.explorer.choices import Choices, choices_at
from saltus.explorer.kinds import kind_of
from saltus.explorer.range_field import RangeField
from saltus.explorer.steps import (
    Cascade,
    Continue,
    FindEquilibrium,
    FindOrbit,
    Follow,
    Place,
    SolveOrbit,
    Step,
    Sweep,
    Switch,
)

if TYPE_CHECKING:
    from saltus.explorer.session import Session
    from saltus.system import HybridSystem

__all__ = ["ActionView", "StartView"]


_NEAR = 1e-6  # of half a range: so near to its end a branch has ended there


class StartView:
    """Buttons that need no selected solution.

    Parameters
    ----------
    session : Session
        Whose parameters and start are taken.
    run : callable
        Called with the `Step` to take.
    observables : callable
        Returns what a sweep should observe for the diagram's ordinate.
    tell : callable
        Called with an error's line.
    """

    def __init__(
        self,
        session: Session,
        run: Callable[[Step], None],
        observables: Callable[[], tuple[str, ...]],
        tell: Callable[[str], None],
    ) -> None:
        self._session, self._run, self._observables = session, run, observables
        orbit = widgets.button(
            "Find orbit", "find-orbit", kind="primary", tip="on which the motion from the start settles"
        )
        widgets.on_click(orbit, lambda: run(FindOrbit(**self._given())))
        rest = widgets.button("Find equilibrium", "find-equilibrium", tip="near the start")
        widgets.on_click(rest, lambda: run(FindEquilibrium(**self._given())))
        self._period = widgets.count("period", 1, 62, (1, 1000), "period")
        near = widgets.button("Solve orbit", "solve-orbit", tip="near the start, stable or not, of so many points")
        widgets.on_click(near, _careful(self._solve, tell))
        nearby = kind_of(session.system).nearby
        rest.visible, near.visible, self._period.visible = nearby == "equilibrium", *[nearby == "orbit"] * 2
        self._range = RangeField(session, "sweep", 118)
        self._count = widgets.count("values", 200, 76, (2, 10_000), "sweep-values")
        self._direction = widgets.choice("direction", ["up", "down"], "up", 76, "select-direction")
        sweep = widgets.button("Sweep", "sweep", tip="follow the attractor by simulation, from the start")
        widgets.on_click(sweep, _careful(self._sweep, tell))
        self.panel = widgets.column(
            widgets.row(orbit, rest, near, self._period, wrap=True), widgets.row(self._range.chooser, self._count),
            widgets.row(*self._range.ends), widgets.row(self._direction, sweep),
        )  # fmt: skip

    def _given(self) -> dict[str, Any]:
        settings = self._session.settings
        return {"parameters": self._session.changed(), "x0": settings.x0, "mode": settings.mode}

    def _solve(self) -> None:
        if self._period.value is None:
            raise InputError("period", "empty", "a whole number")
        given = {name: value for name, value in self._given().items() if name != "mode"}
        self._run(SolveOrbit(period=int(self._period.value), **given))

    def _sweep(self) -> None:
        if self._count.value is None:
            raise InputError("values", "empty", "a whole number")
        given = {name: value for name, value in self._given().items() if name != "mode"}
        step = Sweep(
            parameter=self._range.name, bounds=self._range.bounds, count=int(self._count.value),
            direction=self._direction.value, observables=self._observables(), **given,
        )  # fmt: skip
        self._run(step)


class ActionView:
    """Buttons for what the selected solution allows, and only these.

    Parameters
    ----------
    session : Session
        What is shown.
    run : callable
        Called with the `Step` to take.
    film : callable
        Called when a film of the selected orbit is asked for.
    films : callable
        Returns whether orbits of a system can be filmed.
    tell : callable
        Called with an error's line.
    """

    def __init__(
        self,
        session: Session,
        run: Callable[[Step], None],
        film: Callable[[], None],
        films: Callable[[HybridSystem], bool],
        tell: Callable[[str], None],
    ) -> None:
        self._session, self._run, self._films = session, run, films
        self._first, self._second = RangeField(session, "parameter"), RangeField(session, "and")
        self._second.leave_out(self._first.name)
        widgets.on_change(self._first.chooser, lambda _: self._second.leave_out(self._first.name))
        self._buttons = {
            "resume": widgets.button("Continue", "continue", kind="primary", tip="follow the branch through it"),
            "extend": widgets.button("Extend", "extend", tip="follow the branch on from this end"),
            "switch": widgets.button("Switch branch", "switch", tip="follow the other branch that meets here"),
            "cascade": widgets.button("Cascade", "cascade", tip="follow the next four period doublings"),
            "follow": widgets.button("Follow locus", "follow", tip="follow this point over both parameters"),
            "film": widgets.button("Film", "film", tip="film the motion on this orbit"),
        }
        works = {
            "resume": self._resume,
            "extend": self._extend,
            "switch": self._switch,
            "cascade": self._cascade,
            "follow": self._follow,
        }
        for name, work in (works | {"film": film}).items():
            widgets.on_click(self._buttons[name], _careful(self._while_offered(name, work), tell))
        self._text = widgets.html("selected", margin=(6, 8, 0, 8))
        first = [self._buttons[name] for name in ("resume", "extend", "switch", "cascade", "film")]
        self._one = widgets.row(self._first.chooser, *self._first.ends, *first, wrap=True)
        self._two = widgets.row(self._second.chooser, *self._second.ends, self._buttons["follow"], wrap=True)
        self.panel = widgets.column(self._text, self._one, self._two)
        self.show("")

    def show(self, told: str) -> None:
        """Show what the selected solution allows, below a line of HTML about it."""
        self._text.object = told
        allowed = self._allowed()
        for name, button in self._buttons.items():
            button.visible = allowed[name]
        self._one.visible = any(allowed.values())
        self._two.visible = allowed["follow"]

    def _allowed(self) -> dict[str, bool]:
        """Return which buttons are offered for the selected solution."""
        choices = self._choices()
        return {
            "resume": choices.resume, "extend": choices.resume and bool(self._outwards()),
            "switch": bool(choices.switch), "cascade": choices.cascade,
            "follow": choices.follow and bool(self._second.name), "film": choices.film,
        }  # fmt: skip

    def _while_offered(self, name: str, work: Callable[[], None]) -> Callable[[], None]:
        """Return work that is refused once its button is not offered: a click may come after another selection."""

        def done() -> None:
            if not self._allowed()[name]:
                selected = self._session.settings.selected
                told = "none" if selected is None else selected.of
                button = f"one for which {self._buttons[name].name!r} is offered"
                raise InputError("selected solution", told, button, "it has changed since the page was drawn")
            work()

        return done

    def _choices(self) -> Choices:
        return choices_at(self._session.settings.selected, self._session.results, self._films)

    def _place(self) -> Place:
        selected = self._session.settings.selected
        assert selected is not None  # of none nothing is offered
        return selected

    def _resume(self) -> None:
        what: Any = self._choices().what
        self._run(Continue(place=self._place(), parameter=self._first.name, bounds=self._first.bounds, of=what))

    def _outwards(self) -> str:
        """Return which way the parameter goes beyond the end of a branch that is selected; empty elsewhere."""
        place = self._place()
        values: Any = getattr(self._session.results[place.of], "values", ())
        if place.index is None or len(values) < 2 or place.index not in (0, len(values) - 1):
            return ""
        last, before = (values[0], values[1]) if place.index == 0 else (values[-1], values[-2])
        return "up" if last > before else "down"

    def _extend(self) -> None:
        """Follow a branch on from its end, by half of the range where this ends there."""
        what: Any = self._choices().what
        way: Any = self._outwards()
        place, name = self._place(), self._along()
        end = float(self._session.results[place.of].values[place.index])
        low, high = self._first.bounds_of(name)
        more = 0.5 * (high - low)
        least, most = self._session.system.parameter_bounds.get(name, (-math.inf, math.inf))
        if way == "up" and high <= end + _NEAR * more:
            high = min(end + more, most)
        if way == "down" and low >= end - _NEAR * more:
            low = max(end - more, least)
        bounds = (low, high)
        self._run(Continue(place=place, parameter=name, bounds=bounds, of=what, directions=way))

    def _switch(self) -> None:
        what: Any = self._choices().switch
        along = self._along()
        self._run(Switch(place=self._place(), parameter=along, bounds=self._first.bounds_of(along), of=what))

    def _cascade(self) -> None:
        self._run(Cascade(place=self._place(), bounds=self._first.bounds_of(self._along())))

    def _follow(self) -> None:
        both = self._first, self._second
        names, bounds = (both[0].name, both[1].name), (both[0].bounds, both[1].bounds)
        self._run(Follow(place=self._place(), parameters=names, bounds=bounds))

    def _along(self) -> str:
        """Return the parameter of the branch that the selected point is on: the other branch has it too."""
        result = self._session.results[self._place().of]
        return str(getattr(result, "parameter", self._first.name))


def _careful(work: Callable[[], None], tell: Callable[[str], None]) -> Callable[[], None]:
    """Return work that tells an error in a field instead of raising it."""

    def done() -> None:
        try:
            work()
        except InputError as error:
            tell(str(error))

    return done
