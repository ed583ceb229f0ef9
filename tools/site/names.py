"""Public names in texts become links to their pages of the reference, and each page says where it may be edited."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import examples
import pages
from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode


def _homes() -> dict[str, str]:
    """Pages of bare names and of names as they are called, as ``afm.model``; the front door wins."""
    found: dict[str, str] = {}
    for module, names in examples.public_names().items():
        for name in names:
            full = f"{module}.{name}"
            found[full] = found[full.removeprefix("saltus.")] = f"api/{full}"
            found.setdefault(name, f"api/{full}")
    return found


def _page_of(homes: dict[str, str], docname: str, text: str) -> str | None:
    """Page of a name in a text; on pages of microscopy its functions come first."""
    bare = text.strip().removesuffix("()")
    if docname.startswith(("afm/", "api/saltus.afm.")) and f"afm.{bare}" in homes:
        return homes[f"afm.{bare}"]
    return homes.get(bare)


def _missing(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Node) -> nodes.Node | None:
    """Lead a name in an interpreted text of a docstring to its page."""
    page = _page_of(app.homes, env.docname, node.get("reftarget", ""))  # type: ignore[attr-defined]
    if page is None or page == env.docname:
        return None
    return make_refnode(app.builder, env.docname, page, "", content)


def _link_literals(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Lead a public name in code of a sentence to its page."""
    for node in list(doctree.findall(nodes.literal)):
        parent = node.parent
        while parent is not None and not isinstance(parent, nodes.reference | nodes.title):
            parent = parent.parent
        page = _page_of(app.homes, docname, node.astext())  # type: ignore[attr-defined]
        if parent is None and page is not None and page != docname:
            node.replace_self(make_refnode(app.builder, docname, page, "", node.deepcopy()))


def _place(name: str) -> str:
    """File of the repository that a page comes from; empty for one that is made."""
    if name in pages.sources():
        return pages.sources()[name].relative_to(pages.ROOT).as_posix()
    for one in examples.examples() if name.startswith("gallery/") else ():
        if name == f"gallery/{one.name}":
            return one.file.relative_to(pages.ROOT).as_posix()
    if name.startswith("api/saltus"):
        import pkgutil
        import sys

        home = getattr(pkgutil.resolve_name(name.removeprefix("api/")), "__module__", "saltus")
        return Path(str(sys.modules[home].__file__)).relative_to(pages.ROOT).as_posix()
    return ""


def _edit(app: Sphinx, name: str, template: str, context: dict[str, Any], doctree: nodes.document | None) -> None:
    """Tell the template the file of the page, and where such files are edited.

    SALTUS_EDIT_URL is the address before the file's path; without one the link leads to how pages are written.
    """
    place, host = _place(name), os.environ.get("SALTUS_EDIT_URL", "")
    there = f"{host.rstrip('/')}/{place}" if host else f"{context['pathto']('contributing')}#write"
    context["edited_file"] = place
    context["edited_at"] = there if place else ""


def _start(app: Sphinx) -> None:
    app.homes = _homes()  # type: ignore[attr-defined]


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect all of it."""
    app.connect("builder-inited", _start)
    app.connect("missing-reference", _missing)
    app.connect("doctree-resolved", _link_literals)
    app.connect("html-page-context", _edit)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
