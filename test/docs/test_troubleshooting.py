"""What troubleshooting.md quotes is what the program says."""

import ast
import re
from pathlib import Path

import pytest

GAP = "\0"  # where a message has a name or a number


def said_in(source: Path) -> set[str]:
    """Texts of a module: strings, and formatted strings with `GAP` for what is put in; docstrings do not count."""
    texts, documented = set(), set()
    tree = ast.parse(source.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            documented.add(id(node.value))
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = [part.value if isinstance(part, ast.Constant) else GAP for part in node.values]
            texts.add("".join(map(str, parts)))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
            texts.add(node.value)
    return texts


@pytest.fixture(scope="module")
def texts(repository) -> set[str]:
    folders = [repository / "tracker_node", repository / "tools"]
    return {text for folder in folders for source in folder.rglob("*.py") for text in said_in(source)}


def quoted(page: str) -> list[str]:
    """Messages in the first column of the page's tables: code with a blank in it that is no command, option or topic."""
    cells = [line.split("|")[1] for line in page.splitlines() if line.startswith("| ") and not line.startswith("| you see")]
    codes = [code for cell in cells for code in re.findall(r"`([^`]+)`", cell)]
    return [code for code in codes if " " in code and not re.match(r"tracker_node |make |ros2 |… ros2|No module", code)]


def is_said(message: str, texts: set[str]) -> bool:
    """Whether one text has the parts of a message, in their order."""
    parts = [re.escape(part.strip()) for part in message.split("…") if part.strip()]
    pattern = re.compile(".*".join(parts), re.DOTALL)
    return any(pattern.search(text) for text in texts)


def test_quoted_messages_are_in_the_sources(repository, texts):
    messages = quoted((repository / "docs/troubleshooting.md").read_text())
    assert len(messages) > 25
    unsaid = [message for message in messages if not is_said(message, texts)]
    assert not unsaid


def test_a_message_that_nobody_says_is_noticed(texts):
    assert not is_said("the cat has eaten … images", texts)
    assert is_said("is live: tracker_node camera_ingest publishes it, … read here", texts)
