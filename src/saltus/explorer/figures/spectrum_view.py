"""Multipliers on the unit circle, or eigenvalues beside the imaginary axis; those far away as arrows with numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.explorer import look, widgets
from saltus.explorer.colours import CHOSEN, INK
from saltus.explorer.figures.pointer import tell_at_pointer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.explorer.solutions import Traits

__all__ = ["SpectrumView", "far_from"]

_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 181)
_SIDE = 236  # pixels of the figure's frame
_BORDERS = (66, 14, 28, 52)  # pixels of labels to the left, to the right, above and below
_FAR = 5.0  # modulus of a multiplier from which on it is an arrow
_APART = 50.0  # the same of an eigenvalue, over the smallest one
_ROOM = 1.35  # half the side of the frame, over the largest value within
_RIM = 0.9  # where an arrow stands, over half the side
_LINE = "#5c6570"
_TOLD = ("tip",)  # columns of values besides their places
_ARROW = ("angle", "text", "align", "aside", "below")  # columns of arrows


def far_from(values: NDArray[np.complex128], *, circle: bool) -> NDArray[np.bool_]:
    """Return which values are so far away that the others could not be told apart beside them; shape (value,).

    Parameters
    ----------
    values : ndarray of complex, shape (value,)
        Multipliers or eigenvalues.
    circle : bool
        Whether they are multipliers.
    """
    sizes = np.abs(values)
    if circle:
        return ~(sizes <= _FAR)
    seen = sizes[np.isfinite(sizes) & (sizes > 0.0)]
    return ~(sizes <= _APART * (float(seen.min()) if seen.size else 1.0))


class SpectrumView:
    """The numbers that decide whether a solution is stable."""

    def __init__(self) -> None:
        from bokeh.models import ColumnDataSource

        left, right, above, below = _BORDERS
        self.figure = look.figure_of(
            "multipliers", width=_SIDE + left + right, height=_SIDE + above + below, min_border_left=left,
            min_border_right=right, min_border_top=above, min_border_bottom=below, sizing_mode="fixed",
            toolbar_location=None,
        )  # fmt: skip
        self.numbers = widgets.html("multiplier-table")
        self.values, self.arrows, self._border = (ColumnDataSource(_columns(*names)) for names in (_TOLD, _ARROW, ()))
        made = self.figure
        look.draw(made, "Line", self._border, line_color=_LINE, line_width=1.2)
        look.draw(made, "Scatter", self.values, size=9, fill_color=CHOSEN, line_color=INK, name="values")
        look.draw(
            made, "Scatter", self.arrows, size=11, marker="triangle", angle="angle", fill_color=CHOSEN, line_color=INK,
            name="arrows",
        )  # fmt: skip
        look.draw(
            made, "Text", self.arrows, text="text", text_align="align", text_baseline="middle", x_offset="aside",
            y_offset="below", text_font_size="11px", text_color=INK,
        )  # fmt: skip
        made.xaxis.axis_label, made.yaxis.axis_label = "real part", "imaginary part"
        made.title.text_font_size, made.title.text_font_style = "12px", "normal"
        tell_at_pointer(made, [self.values])
        self.panel = widgets.column(widgets.pane(made, fixed=True), self.numbers)

    def show(self, traits: Traits) -> None:
        """Show the numbers of a solution."""
        values = traits.values
        far = far_from(values, circle=traits.circle)
        near = values[~far]
        texts = [look.complex_text(value) for value in near]
        self.values.data = {"x": near.real.tolist(), "y": near.imag.tolist(), "tip": texts}
        reach = np.abs([*near.real, *near.imag]).max(initial=1.0 if traits.circle else 0.0)
        half = _ROOM * (float(reach) or 1.0)
        self._border.data = _line(half if values.size else 0.0, circle=traits.circle)
        self.arrows.data = _arrows(values[far], half)
        self.figure.title.text = traits.spectrum + ("; arrows lead outside" if far.any() else "")
        look.fit(self.figure, [-half, half], [-half, half], 0.0)
        told = {f"{i + 1}": f"{look.complex_text(value)}   |·| = {abs(value):.9g}" for i, value in enumerate(values)}
        self.numbers.object = look.table(told, ("", "value and modulus")) if told else ""


def _columns(*names: str) -> dict[str, list[Any]]:
    return {name: [] for name in ("x", "y", *names)}


def _line(half: float, *, circle: bool) -> dict[str, list[float]]:
    """Return the border of stability: the unit circle of orbits, the imaginary axis of equilibria."""
    if circle:
        return {"x": np.cos(_CIRCLE).tolist(), "y": np.sin(_CIRCLE).tolist()}
    return {"x": [0.0, 0.0], "y": [-half, half]}


def _arrows(values: NDArray[np.complex128], half: float) -> dict[str, list[Any]]:
    """Return arrows at the rim of the frame towards values outside, with these as texts within the frame."""
    rows = _columns(*_ARROW)
    for value in sorted(values.tolist(), key=lambda value: (-abs(value), value.imag)):
        infinite = not np.isfinite(value)
        way = complex(1.0) if infinite else value / abs(value)
        place = way * (_RIM * half / max(abs(way.real), abs(way.imag)))
        left = place.real >= 0.0
        same = sum(abs(complex(x, y) - place) < 0.15 * half for x, y in zip(rows["x"], rows["y"], strict=True))
        row = {
            "x": place.real, "y": place.imag, "angle": float(np.angle(way)) - 0.5 * np.pi,
            "text": "infinite" if infinite else look.rounded_text(value), "align": "right" if left else "left",
            "aside": -10 if left else 10, "below": 15 * same,
        }  # fmt: skip
        for key, entry in row.items():
            rows[key].append(entry)
    return rows
