"""Write what Sphinx reads into build/site-source, and have it built; a file that stays the same is not touched."""

from __future__ import annotations

import inspect
import json
import os
import re
import sys
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import examples as gallery
import pages

ROOT = pages.ROOT
SOURCE = ROOT / "build" / "site-source"
THUMBNAIL = 360  # pixels of width
MOST = 8  # links of one kind on a page of the reference
HEADINGS = {
    "saltus": "Everything begins here: systems, orbits, branches, basins, sweeps, fits.",
    "saltus.afm": "Tapping-mode atomic force microscopy.",
    "saltus.results": "What computations return.",
    "saltus.options": "Options of computations.",
    "saltus.errors": "What is raised.",
}


class Staging:
    """Files written in this run; those of an earlier one that are not among them go."""

    def __init__(self) -> None:
        self.written: set[Path] = set()

    def write(self, name: str, content: str | bytes) -> None:
        file = SOURCE / name
        content = content.encode() if isinstance(content, str) else content
        self.written.add(file)
        if not file.exists() or file.read_bytes() != content:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)

    def copy(self, name: str, file: Path) -> None:
        self.write(name, file.read_bytes())

    def sweep(self) -> None:
        for file in SOURCE.rglob("*"):
            if file.is_file() and file not in self.written:
                file.unlink()


def thumbnail(picture: Path) -> bytes:
    """The picture, small."""
    from PIL import Image

    image = Image.open(picture).convert("RGB")
    image = image.resize((THUMBNAIL, round(THUMBNAIL * image.height / image.width)), Image.Resampling.LANCZOS)
    stream = BytesIO()
    image.quantize(64).save(stream, "PNG", optimize=True)
    return stream.getvalue()


def stage_gallery(staging: Staging, public: set[str]) -> dict[str, list[gallery.Example]]:
    """Write the gallery; return the examples of each public name that one uses."""
    uses: dict[str, list[gallery.Example]] = {}
    every = gallery.examples()
    index = ["# Gallery", "", "Each example is one script with one picture, and runs in seconds.", ""]
    for field in gallery.FIELDS:
        those = [one for one in every if one.field == field]
        if those:
            index += [f"## {field}", "", "::::{grid} 2 2 3 4", ":gutter: 2", ":class-container: gallery", ""]
            for one in those:
                index += [f":::{{grid-item-card}} {one.title}", f":link: {one.name}", ":link-type: doc"]
                index += [f":img-top: small/{one.name}.png", f":img-alt: {one.title}", ":::"]
            index += ["::::", ""]
    entries = "\n".join(one.name for one in every)
    index += ["```{toctree}", ":hidden:", "", entries, "```", ""]
    staging.write("gallery/index.md", "\n".join(index))
    for one in every:
        used = sorted(gallery.names_used(one.code) & public)
        for name in used:
            uses.setdefault(name, []).append(one)
        staging.copy(f"gallery/scripts/{one.name}.py", one.file)
        staging.write(f"gallery/scripts/{one.name}.ipynb", gallery.notebook(one))
        staging.copy(f"images/gallery/{one.name}.png", one.picture)
        staging.write(f"gallery/small/{one.name}.png", thumbnail(one.picture))
        calls = ", ".join(f"[`{name.removeprefix('saltus.')}`](../api/{name}.rst)" for name in used)
        title = re.sub(r"(?m)^(    )?(?=\S)", "", one.words)
        staging.write(
            f"gallery/{one.name}.md",
            f"# {one.title}\n\n{title}\n\n![{one.title}](../images/gallery/{one.name}.png)\n\n"
            f"Download: {{download}}`script <scripts/{one.name}.py>`, "
            f"{{download}}`notebook <scripts/{one.name}.ipynb>`.\n\n"
            f"```python\n{one.code}```\n\nCalls in the reference: {calls}.\n",
        )
    return uses


def mentions(public: set[str]) -> dict[str, list[str]]:
    """Pages whose Python blocks use each public name, in the order of the shelves."""
    found: dict[str, list[str]] = {}
    files = pages.sources()
    for name in (page for below in pages.children().values() for page in below if page in files):
        if not name.startswith("decisions/"):
            text = files[name].read_text(encoding="utf-8")
            blocks = re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
            for used in sorted({one for block in blocks for one in gallery.names_used(block)} & public):
                found.setdefault(used, []).append(name)
    return found


def returned(names: dict[str, list[str]]) -> dict[str, list[str]]:
    """Public names that the annotations of each public function name: what it returns, and its options."""
    homes = {name: f"{module}.{name}" for module, each in names.items() for name in each}
    found = {}
    for module, each in names.items():
        for name in each:
            value = getattr(import_module(module), name)
            if inspect.isfunction(value):
                words = set(re.findall(r"\w+", " ".join(str(a) for a in value.__annotations__.values())))
                found[f"{module}.{name}"] = sorted(homes[w] for w in words & set(homes))
    return found


def kind(value: Any) -> str:
    """What autodoc calls a public object."""
    if inspect.isclass(value):
        return "exception" if issubclass(value, BaseException) else "class"
    return "function" if inspect.isroutine(value) else "data"


def reference_page(module: str, name: str, mine: dict[str, Any]) -> str:
    """Page of a public name: its docstring, and the names, pages and examples that belong to it."""
    full = f"{module}.{name}"
    what = kind(getattr(import_module(module), name))
    lines = [full, "=" * len(full), "", f".. currentmodule:: {module}", "", f".. auto{what}:: {name}"]
    if what in ("class", "exception"):
        lines += ["   :members:", "   :inherited-members: Exception, tuple, BaseException"]
    if others := [f"   ~{other.removeprefix(f'{module}.')}" for other in mine["also"]]:
        lines += ["", ".. rubric:: See also", "", ".. autosummary::", "", *others]
    if mine["pages"]:
        lines += ["", ".. rubric:: Pages that use it", "", *(f"- :doc:`/{page}`" for page in mine["pages"])]
    if mine["examples"]:
        lines += ["", ".. rubric:: Examples in the gallery", ""]
        lines += [f"- :doc:`{title} </gallery/{one}>`" for one, title in mine["examples"]]
    return "\n".join([*lines, ""])


def stage_reference(staging: Staging, uses: dict[str, list[gallery.Example]], names: dict[str, list[str]]) -> None:
    """Write the list of functions and classes, and a page for each."""
    title = "Functions and classes"
    lines = [title, "=" * len(title), ""]
    belonging = related(uses, names)
    for module, each in names.items():
        lines += [module, "-" * len(module), "", HEADINGS[module], "", f".. currentmodule:: {module}", ""]
        lines += [".. autosummary::", "   :toctree: .", "", *(f"   {name}" for name in each), ""]
        for name in each:
            staging.write(f"api/{module}.{name}.rst", reference_page(module, name, belonging[f"{module}.{name}"]))
    staging.write("api/index.rst", "\n".join(lines))


def related(uses: dict[str, list[gallery.Example]], names: dict[str, list[str]]) -> dict[str, dict[str, Any]]:
    """For each public name the pages, the examples and the other names that belong to it."""
    public = {f"{module}.{name}" for module, each in names.items() for name in each}
    on_pages = mentions(public)
    linked = returned(names)
    found = {}
    for name in sorted(public):
        makers = sorted(function for function, results in linked.items() if name in results)
        shown = list(dict.fromkeys([*uses.get(name, []), *(one for maker in makers for one in uses.get(maker, []))]))
        told = list(dict.fromkeys([*on_pages.get(name, []), *(p for maker in makers for p in on_pages.get(maker, []))]))
        also = list(dict.fromkeys([*linked.get(name, []), *makers]))
        if name.rpartition(".")[0] == "saltus.errors":
            also += [other for other in public if other.startswith("saltus.errors.") and other not in (name, *also)]
        found[name] = {
            "also": sorted(also)[: 2 * MOST],
            "pages": [page for page in told if page != "index"][:MOST],
            "examples": [(one.name, one.title) for one in shown[:MOST]],
        }
    return found


def stage() -> None:
    """Write everything."""
    staging = Staging()
    names = gallery.public_names()
    public = {f"{module}.{name}" for module, each in names.items() for name in each}
    uses = stage_gallery(staging, public)
    stage_reference(staging, uses, names)
    below = pages.children()
    below["reference"] = ["api/index", *below.get("reference", [])]
    blocks = {
        "api": "- [Functions and classes](api/index.rst): every public name, with its example.",
        "gallery": "- [Gallery](gallery/index.md): one picture an example.",
    }
    for name, file in pages.sources().items():
        staging.write(f"{name}.md", pages.prepared(name, file, below.get(name, []), blocks))
        for target in re.findall(r"\]\(([^)#:\s]+)", pages.FENCE.sub("", file.read_text(encoding="utf-8"))):
            path = (file.parent / target).resolve()
            if path.is_file() and pages.page_at(path) is None and not path.is_relative_to(pages.DOCS):
                staging.copy(f"files/{path.relative_to(ROOT).as_posix()}", path)
    for picture in sorted((pages.DOCS / "images").rglob("*.*")):
        staging.copy(f"images/{picture.relative_to(pages.DOCS / 'images').as_posix()}", picture)
    staging.sweep()


def switcher(site: Path) -> str:
    """The list of versions that each page offers: those whose folders stand in the site, the newest first."""
    folders = (found.name for found in site.iterdir() if re.fullmatch(r"\d+(\.\d+)*", found.name))
    versions = sorted(folders, key=lambda name: [*map(int, name.split("."))], reverse=True)
    entries = [
        {"name": name, "version": name, "url": f"../{name}/", "preferred": place == 0}
        for place, name in enumerate(versions)
    ]
    return json.dumps(entries, indent=1) + "\n"


def main() -> int:
    """Stage, then let Sphinx build into build/site/VERSION."""
    from sphinx.cmd.build import build_main

    version = import_module("saltus").__version__
    stage()
    here = str(Path(__file__).parent)
    target = ROOT / "build" / "site" / version
    workers = str(min(4, os.cpu_count() or 1))
    kept = ["-d", str(ROOT / "build" / "site-trees"), "-c", here]
    strict = ["-b", "html", "-W", "--keep-going", "-q", "-j", workers]
    status = build_main([*strict, *kept, *sys.argv[1:], str(SOURCE), str(target)])
    (target.parent / "switcher.json").write_text(switcher(target.parent), encoding="utf-8")
    if not status:
        print(f"built: {(target / 'index.html').relative_to(ROOT)}")
    return int(status)


if __name__ == "__main__":
    sys.exit(main())
