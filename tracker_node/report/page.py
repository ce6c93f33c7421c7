"""A page of tables and pictures that needs nothing beside it: what an experiment leaves for its reader."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

import jinja2

from .metrics_file import command_line, cpu, versions


@dataclass(frozen=True)
class Section:
    """A heading with a sentence, then a table (first row: headings), a picture (PNG), or plain text; empty ones are left out."""

    title: str
    text: str = ""
    table: Sequence[Sequence[str]] = ()
    picture: Path | None = None
    preformatted: str = ""


def write_page(path: str | Path, title: str, sections: Sequence[Section]) -> None:
    """Write the page as HTML; folders are made."""
    source = files(__package__).joinpath("templates/experiment.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    page = environment.from_string(source).render(
        title=title, sections=[(section, _data_uri(section.picture)) for section in sections], command=command_line(),
        versions=versions(), cpu=cpu(), made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )  # fmt: skip
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(page, encoding="utf-8")


def _data_uri(picture: Path | None) -> str:
    return "" if picture is None else f"data:image/png;base64,{base64.b64encode(picture.read_bytes()).decode()}"
