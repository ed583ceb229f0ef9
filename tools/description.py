"""The description that goes out with the package: README.md where no file of the checkout is beside it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_PICTURE = re.compile(r"^!\[[^\]]*\]\((?!https?:)[^)]*\)\n\n", re.MULTILINE)
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!https?:)[^)]*\)")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_LISTS = re.compile(r"^## Read on\n.*?(?=^## )", re.DOTALL | re.MULTILINE)


def description(readme: str) -> str:
    """Return the text without pictures of the checkout, its list of pages, and comments; a link leaves its words."""
    return _LINK.sub(r"\1", _PICTURE.sub("", _COMMENT.sub("", _LISTS.sub("", readme))))


class Description(MetadataHookInterface):
    """What hatchling calls for the field `readme`."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the description."""
        text = description((Path(self.root) / "README.md").read_text(encoding="utf-8"))
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
