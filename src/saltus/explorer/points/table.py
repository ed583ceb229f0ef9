"""The special points of all results as a table: what each is, where, with which normal form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

from saltus.continuation.results.curve import SolutionCurve
from saltus.errors import SaltusError
from saltus.explorer import look
from saltus.explorer.colours import form_of
from saltus.explorer.points.wishes import wish
from saltus.explorer.steps import Place
from saltus.plotting.space import coordinates_of

__all__ = ["COLUMNS", "Row", "rows_of", "sorted_rows", "table_of", "text_of"]

COLUMNS = ("result", "point", "meaning", "x", "y", "normal form")  # what the table can be sorted by


_NUMBERS = ("x", "y")
_NUMBER = ' class="number"'


class Row(NamedTuple):
    """A special point."""

    of: str  # name of its result
    label: str
    type: str
    position: float  # place among the points of its result
    x: float  # the diagram's quantities there; NaN where the result has none of this name
    y: float
    form: str  # its normal form in words; empty where its type has none
    locus: str = ""  # type of the locus on which it lies; empty on a branch


def rows_of(results: Mapping[str, Any], axes: tuple[str, str], forms: Mapping[tuple[str, str], str]) -> list[Row]:
    """Return the special points of branches and loci.

    Parameters
    ----------
    results : mapping of str to Result
        The results by name.
    axes : (str, str)
        What the diagram shows.
    forms : mapping of (str, str) to str
        Normal forms in words, by result and label, as far as they are known.
    """
    return [
        Row(
            name, point.label, point.type, float(point.position), _at(curve, point, axes[0]),
            _at(curve, point, axes[1]), forms.get((name, point.label), ""), point.locus,
        )
        for name, curve in results.items()
        if isinstance(curve, SolutionCurve)
        for point in curve.special_points
    ]  # fmt: skip


def _meaning(row: Row) -> str:
    return form_of(row.type, row.locus).meaning


def _at(curve: Any, point: Any, name: str) -> float:
    try:
        return float(coordinates_of(curve, point, (name,))[0])
    except SaltusError:
        return float("nan")


def sorted_rows(rows: Sequence[Row], column: str, *, falling: bool = False) -> list[Row]:
    """Return rows sorted by one of `COLUMNS`; rows that are alike keep their order.

    Parameters
    ----------
    rows : sequence of Row
        The rows.
    column : str
        The column.
    falling : bool, optional
        Whether the largest comes first; places without a number come last in any case.
    """
    keys: Mapping[str, Any] = {
        "result": lambda row: (_numbered(row.of), row.position), "point": lambda row: _numbered(row.label),
        "meaning": _meaning, "x": lambda row: row.x, "y": lambda row: row.y,
        "normal form": lambda row: row.form,
    }  # fmt: skip
    told = [row for row in rows if column not in ("x", "y") or keys[column](row) == keys[column](row)]
    rest = [row for row in rows if row not in told]
    return [*sorted(told, key=keys[column], reverse=falling), *rest]


def _numbered(name: str) -> tuple[str, int]:
    """Return a name by its letters and its number, so that SN10 comes after SN9."""
    letters = name.rstrip("0123456789")
    return letters, int(name[len(letters) :] or 0)


def table_of(rows: Sequence[Row], axes: tuple[str, str], column: str, selected: Place | None) -> str:
    """Return HTML of the table: heads that sort it, rows that select a point.

    Parameters
    ----------
    rows : sequence of Row
        The rows, sorted.
    axes : (str, str)
        What the diagram shows.
    column : str
        The column by which they are sorted; with a minus before it the largest comes first.
    selected : Place or None
        The solution that is selected.
    """
    if not rows:
        return "<p class='hint'>No special points yet. Continue an orbit or an equilibrium in a parameter.</p>"
    heads = dict(zip(COLUMNS, (*COLUMNS[:3], *map(look.bare_label, axes), COLUMNS[-1]), strict=True))
    top = "".join(_head(name, told, column) for name, told in heads.items())
    lines = "".join(_line(row, selected) for row in rows)
    return (
        f'<div class="scroll"><table class="points"><thead><tr>{top}</tr></thead><tbody>{lines}</tbody></table></div>'
    )


def _head(name: str, told: str, column: str) -> str:
    """Return the head of a column: a button that sorts by it, with an arrow where the table is so sorted."""
    falling, mine = column.startswith("-"), name == column.removeprefix("-")
    sorting = f' aria-sort="{"descending" if falling else "ascending"}"' if mine else ""
    arrow = (" ▾" if falling else " ▴") if mine else ""
    button = f"<button {wish('sort', name)} title='sort by this column'>{escape(told)}{arrow}</button>"
    return f"<th{_NUMBER if name in _NUMBERS else ''}{sorting}>{button}</th>"


def _line(row: Row, selected: Place | None) -> str:
    form, chosen = form_of(row.type, row.locus), selected == Place(of=row.of, label=row.label)
    cells = [
        f"<td>{escape(row.of)}</td>",
        f'<td><button class="point" {wish("take", row.of, row.label)}>'
        f'<span class="swatch round" style="background:{form.colour}"></span>{escape(row.label)}</button></td>',
        f"<td>{escape(form.meaning)}</td>",
        *(f"<td{_NUMBER}>{_number(value)}</td>" for value in (row.x, row.y)),
        f"<td>{escape(row.form.replace('-', '−'))}</td>",
    ]
    mark = ' aria-selected="true"' if chosen else ""
    return f"<tr{mark} {wish('take', row.of, row.label)}>{''.join(cells)}</tr>"


def _number(value: float) -> str:
    return "" if value != value else look.number(value).replace("-", "−")


def text_of(rows: Sequence[Row], axes: tuple[str, str]) -> str:
    r"""Return the table as text with tabs between its columns, as spreadsheets take it; numbers in full.

    Examples
    --------
    >>> text_of([Row("branch1", "SN1", "SN", 3.5, 1.5, 0.25, "nondegenerate")], ("a", "max_z")).splitlines()[1]
    'branch1\tSN1\tsaddle-node\t1.5\t0.25\tnondegenerate'
    """
    lines: list[tuple[str, ...]] = [("result", "point", "meaning", *axes, "normal form")]
    lines += [
        (row.of, row.label, _meaning(row), *("" if v != v else repr(v) for v in (row.x, row.y)), row.form)
        for row in rows
    ]
    return "".join("\t".join(line) + "\n" for line in lines)
