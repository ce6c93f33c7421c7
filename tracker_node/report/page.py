"""A page of tables and images that needs nothing beside it: what an experiment or a calibration leaves for its reader."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import cv2
import jinja2
import numpy as np

from .metrics_file import command_line, cpu, today, versions


@dataclass(frozen=True, eq=False)
class PageSection:
    """A heading with a sentence, then a table, an image, or plain text; what is empty is left out.

    Parameters
    ----------
    table : rows of texts, the first of them the headings.
    image : a PNG file, or pixels (h, w, 3) BGR.
    """

    title: str = ""
    text: str = ""
    table: Sequence[Sequence[str]] = ()
    image: Path | np.ndarray | None = None
    preformatted: str = ""


def write_page(path: str | Path, title: str, sections: Sequence[PageSection]) -> None:
    """Write a page as HTML; folders are made.

    Parameters
    ----------
    path : of the page.
    title : its heading.
    sections : from top to bottom.
    """
    source = files(__package__).joinpath("templates/page.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    page = environment.from_string(source).render(
        title=title, sections=[(section, _data_uri(section.image)) for section in sections], command=command_line(),
        versions=versions(), cpu=cpu(), made=today(),
    )  # fmt: skip
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(page, encoding="utf-8")


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """Rows of text in columns; all but the first column to the right."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def _data_uri(image: Path | np.ndarray | None) -> str:
    if image is None:
        return ""
    png = image.read_bytes() if isinstance(image, Path) else cv2.imencode(".png", image)[1].tobytes()
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
