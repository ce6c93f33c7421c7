"""The pages of the documentation as the tests read them: blocks of code, and the command lines in them.

An indented block, or a fenced one without a language, is shell: each of its lines is a command. What is none (files, what a
command prints) stands in a fenced block that says so.
"""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PAGES = ("README.md", "CONTRIBUTING.md", *sorted(f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md")))
SHELL = ("", "sh")
_PARTS = re.compile(
    r"^#+ (?P<heading>[^\n]*)\n|^```(?P<language>\w*)\n(?P<fenced>.*?)^```|(?P<indented>(?:^    [^\n]*\n)+)",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Command:
    """A command line as it stands on a page under a heading, continued lines joined, without its comment."""

    page: str
    section: str
    text: str

    def __str__(self) -> str:
        return f"{self.page}: {self.text}"

    @property
    def words(self) -> list[str]:
        return shlex.split(self.text)


@dataclass(frozen=True)
class Block:
    """A block of code on a page under a heading; ``language`` is empty where the page says none."""

    page: str
    section: str
    language: str
    text: str

    @property
    def commands(self) -> list[Command]:
        """Those of a shell block, in their order."""
        if self.language not in SHELL:
            return []
        lines = (re.sub(r"\s+#.*$", "", line).strip() for line in self.text.replace("\\\n", " ").splitlines())
        return [Command(self.page, self.section, re.sub(r"\s+", " ", line)) for line in lines if line]


def blocks_of(page: str) -> Iterator[Block]:
    """The blocks of a page of `PAGES`, from top to bottom."""
    section = ""
    for part in _PARTS.finditer((ROOT / page).read_text()):
        if part["heading"] is not None:
            section = part["heading"]
        elif part["indented"] is not None:
            yield Block(page, section, "", re.sub(r"^    ", "", part["indented"], flags=re.MULTILINE))
        else:
            yield Block(page, section, part["language"], part["fenced"])


def commands_of(page: str) -> list[Command]:
    """All command lines of a page."""
    return [command for block in blocks_of(page) for command in block.commands]


def mentions_of(page: str) -> list[str]:
    """What a page sets in code within its sentences and tables."""
    prose = re.sub(r"^```.*?^```|^    [^\n]*$", "", (ROOT / page).read_text(), flags=re.MULTILINE | re.DOTALL)
    return [span.replace("\n", " ") for span in re.findall(r"`([^`]+)`", prose)]
