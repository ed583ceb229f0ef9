"""Formulas as MathML, made when the site is built, in a mathematical font that the site brings along."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import pages
from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.application import Sphinx
from sphinx.util import logging

_CONVERTER = LatexToMathML()
_LOGGER = logging.getLogger(__name__)

# Latin, Greek, punctuation, letter-like signs, arrows, operators, brackets, mathematical alphabets
_RANGES = ((0x20, 0x24F), (0x2B0, 0x3FF), (0x2000, 0x206F), (0x2070, 0x218F), (0x2190, 0x23FF))
_RANGES += ((0x25A0, 0x25FF), (0x27C0, 0x2AFF), (0x1D400, 0x1D7FF))


def _mathml(writer: Any, node: nodes.Element, display: bool) -> str:
    """Convert one formula; what cannot be converted is a warning."""
    try:
        return str(_CONVERTER.convert_with_local_state(pages.with_fences(node.astext()), displaystyle=display))
    except LatexError as error:
        _LOGGER.warning("formula %s: %s", node.astext(), error, location=node)
        return writer.encode(node.astext())


def _visit_math(writer: Any, node: nodes.Element) -> None:
    writer.body.append(_mathml(writer, node, display=False))
    raise nodes.SkipNode


def _visit_math_block(writer: Any, node: nodes.Element) -> None:
    writer.body.append(f'<div class="formula">{_mathml(writer, node, display=True)}</div>\n')
    raise nodes.SkipNode


def _write_font(app: Sphinx, error: Exception | None) -> None:
    """Write the font's part that formulas may use."""
    from fontTools import subset

    target = Path(app.outdir) / "_static" / "formulas.woff"
    if error is not None or app.builder.format != "html" or target.exists():
        return
    options = subset.Options(flavor="woff", layout_features=["ssty", "dtls", "flac"], drop_tables=["DSIG"])
    font = subset.load_font(str(files("ziamath.fonts") / "STIXTwoMath-Regular.ttf"), options)
    small = subset.Subsetter(options)
    small.populate(unicodes=[code for first, last in _RANGES for code in range(first, last + 1)])
    small.subset(font)
    subset.save_font(font, str(target), options)


def setup(app: Sphinx) -> dict[str, Any]:
    """Say to Sphinx how formulas are written."""
    app.add_html_math_renderer("mathml", (_visit_math, None), (_visit_math_block, None))
    app.config.html_math_renderer = "mathml"  # type: ignore[attr-defined]
    app.connect("build-finished", _write_font)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
