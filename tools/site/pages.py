"""Which pages the site has, on which shelf each stands, and what a page becomes for Sphinx.

A shelf is a page with lists of links. Its list is its table of contents, so that nothing says it twice. A page that no
shelf lists stands below the first page that links to it.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
SHELVES = ("start", "how_to", "theory", "reference")
OUTSIDE = {"CHANGELOG.md": "changes", "CONTRIBUTING.md": "contributing", "benchmarks/README.md": "benchmarks"}
GALLERY = "gallery/index"

LINK = re.compile(r"\]\(([^)#:\s]+)?(#[^)\s]*)?\)")
_OPENING, _CLOSING = re.compile(r"\\[bB]igl?(?=[(\[])"), re.compile(r"\\[bB]igr?(?=[)\]])")
ITEM = re.compile(r"^(?:- |\d+\. ).*?(?=^(?:- |\d+\. |\S)|^$|\Z)", re.DOTALL | re.MULTILINE)
FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
DOOR = re.compile(r"^- \[!\[([^\]]*)\]\(([^)]*)\)\]\(([^)]*)\)\s+\*\*(.*?)\*\*[.:]?\s*(.*)", re.DOTALL)


def sources() -> dict[str, Path]:
    """Names of all written pages, each with its file."""
    pages = {file.relative_to(DOCS).with_suffix("").as_posix(): file for file in sorted(DOCS.rglob("*.md"))}
    return pages | {name: ROOT / file for file, name in OUTSIDE.items()}


def page_at(target: Path) -> str | None:
    """Name of the page that shows the file `target` of the repository, or None."""
    place = target.relative_to(ROOT).as_posix()
    if place in OUTSIDE:
        return OUTSIDE[place]
    if place == "README.md":
        return "index"
    if target.parent in (ROOT / "examples", ROOT / "examples" / "gallery") and target.suffix == ".py":
        return f"gallery/{target.stem}"
    if place == "examples":
        return GALLERY
    return target.relative_to(DOCS).with_suffix("").as_posix() if target.suffix == ".md" else None


def links(file: Path, text: str) -> list[str]:
    """Names of the pages to which a text of `file` leads, in its order."""
    targets = [(file.parent / found[1]).resolve() for found in LINK.finditer(FENCE.sub("", text)) if found[1]]
    return [page for target in targets if (page := page_at(target)) is not None]


def children() -> dict[str, list[str]]:
    """Pages below each page, in order: those of a shelf's lists, then those that only other pages know."""
    pages = sources()
    texts = {name: file.read_text(encoding="utf-8") for name, file in pages.items()}
    below: dict[str, list[str]] = {"index": [*SHELVES, GALLERY]}
    placed = {"index", *below["index"]}

    def adopt(parent: str, found: list[str]) -> list[str]:
        new = [name for name in dict.fromkeys(found) if name in pages and name not in placed]
        placed.update(new)
        below.setdefault(parent, []).extend(new)
        return new

    waiting: list[str] = []
    for shelf in SHELVES:
        items = ITEM.findall(FENCE.sub("", texts[shelf]))
        waiting += adopt(shelf, [page for item in items for page in links(pages[shelf], item)])
    while waiting:
        name = waiting.pop(0)
        waiting += adopt(name, links(pages[name], texts[name]))
    return below


def doors(text: str) -> str:
    """The text with each list of linked pictures as a grid of cards."""

    def grid(block: str) -> str:
        lines = ["::::{grid} 1 2 3 3", ":gutter: 3", ":class-container: doors", ""]
        for item in ITEM.findall(block):
            door = DOOR.match(item)
            if door is None:
                raise ValueError(f"a list of pictures has an item without one: {item}")
            alt, picture, target, title, words = door.groups()
            lines += [f":::{{grid-item-card}} {title}", f":link: {target.removesuffix('.md')}", ":link-type: doc"]
            lines += [f":img-top: {picture}", f":img-alt: {alt}", "", " ".join(words.split()), ":::"]
        return "\n".join([*lines, "::::", ""])

    return re.sub(
        r"^- \[!\[.*?(?=^\S(?<!-)|^$(?!\n- \[!)|\Z)", lambda f: grid(f[0]), text, flags=re.DOTALL | re.MULTILINE
    )


def prepared(name: str, file: Path, below: list[str], blocks: dict[str, str]) -> str:
    """The text of a page for Sphinx: links between pages of the site, doors, and the pages below it."""
    folder = Path(name).parent

    def relative(path: str) -> str:
        return os.path.relpath(path, folder)

    def link(found: re.Match[str]) -> str:
        target, anchor = found[1], found[2] or ""
        if not target:
            return found[0]
        path = (file.parent / target).resolve()
        page = page_at(path)
        if page is not None:
            return f"]({relative(page + '.md')}{anchor})"
        if path.is_relative_to(DOCS):
            return f"]({relative(path.relative_to(DOCS).as_posix())})"
        return f"]({relative('files/' + path.relative_to(ROOT).as_posix())})"

    text = file.read_text(encoding="utf-8")
    parts = re.split(f"({FENCE.pattern})", text, flags=re.DOTALL | re.MULTILINE)
    text = "".join(part if part.startswith("```") else LINK.sub(link, part) for part in parts)
    for key, block in blocks.items():
        text = text.replace(f"<!-- site: {key} -->", block)
    text = re.sub(r" ?<!--.*?-->", lambda f: "\n" * f[0].count("\n"), text, flags=re.DOTALL)
    text = doors(text).replace("```mermaid\n", "```text\n")  # a drawing would need a script from elsewhere
    if below:
        depth = "\n:titlesonly:\n" if name != "index" else "\n"
        entries = "\n".join(relative(page) for page in below)
        text += f"\n```{{toctree}}\n:hidden:{depth}\n{entries}\n```\n"
    return text


def with_fences(formula: str) -> str:
    """Return a formula whose large brackets grow with what they enclose.

    Browsers leave a closing bracket of a given size small where it has an exponent.
    """
    return _CLOSING.sub(r"\\right", _OPENING.sub(r"\\left", formula))
