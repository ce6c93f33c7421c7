"""Files gone wrong, from a valid one: in what they hold, in how they are written, in their bytes; each can be had again."""

from __future__ import annotations

import copy
import math
import random
from collections.abc import Callable, Iterator
from typing import Any

import yaml

JUNK: tuple[Any, ...] = (
    None, "", " ", "text", "1e400", "1_0", True, False, 0, -1, 7, 10**30, -(10**18), -0.5, 1e-300, 1e308, math.nan, math.inf,
    -math.inf, [], [[]], [None], {}, {"a": 1}, {1: 2}, [1, 2], [1, 2, 3], [math.nan] * 3, ["x", "y", "z"], [[1, 0], [0]],
    [[1, 0, 0], [0, 1, 0], [0, 0, 0]], [0] * 5000, "base", "../../etc/passwd", "équi", "\u202egnp", "\U0001f984", "a\x07b",
    "a\x00b", "x" * 20000, "%s%n{0}{self}", "${HOME}", "!!python/object/apply:os.system ['true']",
)  # fmt: skip
NUMBERS = ("nan", "inf", "-inf", "1e400", "-1", "0", "1e308", "-1e-320", "", "x", "1_0", "0x10", "٣", "1,5", "1 2", "--1", "1e")
CHARACTERS = "{}[]:,&*!|>'\"%@`\t-#?<=/\\\x00\x07\x1b\x7f\x85\ufeffé\u2028\U0001f984 \n"


def places(values: Any, path: tuple = ()) -> Iterator[tuple]:
    """Paths of every node below the top."""
    items = values.items() if isinstance(values, dict) else enumerate(values) if isinstance(values, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


def _nested(rng: random.Random) -> Any:
    value: Any = 1
    for _ in range(rng.choice((3, 50, 150))):
        value = [value] if rng.random() < 0.5 else {"a": value}
    return value


def _other_length(value: Any, rng: random.Random) -> Any:
    """A list longer or shorter, a text or number changed."""
    if isinstance(value, list) and value:
        return rng.choice((value[:-1], [*value, copy.deepcopy(value[0])], value * 3, [value], value[::-1], []))
    if isinstance(value, bool) or value is None:
        return rng.choice(JUNK)
    if isinstance(value, (int, float)):
        return rng.choice((-value, value * 1e9, value * 1e-9, str(value), [value], 1.0 / (value or 1e-9), value + 1e-7))
    if isinstance(value, str):
        return rng.choice((value.upper(), value + "x", value[1:], [value], value + "\n", value * 50))
    return rng.choice((list(value), [value], "text"))


def damage_content(values: dict, rng: random.Random) -> dict:
    """A copy with one node replaced, taken out, renamed, doubled, moved or of another length."""
    result = copy.deepcopy(values)
    path = rng.choice(list(places(result)))
    parent = result
    for key in path[:-1]:
        parent = parent[key]
    key = path[-1]
    action = rng.choice(("junk", "junk", "junk", "length", "length", "remove", "rename", "more", "swap", "nest"))
    if action == "remove":
        del parent[key]
    elif action == "rename" and isinstance(parent, dict):
        parent[rng.choice(("x", 3, "Name", "", None, True, 1.5, f"{key} ", str(key).upper()))] = parent.pop(key)
    elif action == "more" and isinstance(parent, dict):
        parent[rng.choice(("extra", f"{key}2", "__class__", "_private"))] = copy.deepcopy(parent[key])
    elif action == "more":
        parent.append(copy.deepcopy(parent[key]))
    elif action == "swap" and isinstance(parent, dict):
        other = rng.choice(list(parent))
        parent[key], parent[other] = parent[other], parent[key]
    elif action == "nest":
        parent[key] = _nested(rng)
    else:
        parent[key] = _other_length(parent[key], rng) if action == "length" else copy.deepcopy(rng.choice(JUNK))
    return result


def yaml_text(values: dict) -> str:
    return yaml.dump(values, Dumper=yaml.CSafeDumper, sort_keys=False, allow_unicode=True)


def bomb(key: str, merge: bool) -> str:
    """Ten levels of ten aliases each: 10^10 values once they are written out."""
    lines = ["bomb0: &b0 {a0: 1}" if merge else "bomb0: &b0 [x, x, x, x, x, x, x, x, x, x]"]
    for i in range(1, 11):
        aliases = ", ".join([f"*b{i - 1}"] * 10)
        lines.append(f"bomb{i}: &b{i} {{<<: [{aliases}]}}" if merge else f"bomb{i}: &b{i} [{aliases}]")
    return "\n".join(lines) + f"\n{key}: *b10\n"


def bomb_within(key: str) -> str:
    levels = ["[x, x, x, x, x, x, x, x, x, x]", *(f"[{', '.join([f'*c{i}'] * 10)}]" for i in range(10))]
    return f"{key}:\n" + "".join(f"- &c{i} {level}\n" for i, level in enumerate(levels))


def damage_yaml(values: dict, rng: random.Random) -> bytes:
    """YAML that is no mapping, refers to itself, gives a key twice, or has what a file of ours may not hold."""
    text, key = yaml_text(values), str(rng.choice(list(values)))
    without = yaml_text({name: value for name, value in values.items() if str(name) != key})
    return rng.choice((
        lambda: f"{text}{key}: 1\n",
        lambda: without + bomb(key, merge=False),
        lambda: without + bomb(key, merge=True),
        lambda: without + bomb_within(key),
        lambda: f"{without}{key}: &self [*self]\n",
        lambda: f"{without}{key}: &self {{a: *self}}\n",
        lambda: f"{without}{key}: *nowhere\n",
        lambda: f"{without}{key}: !!python/object/apply:os.getcwd []\n",
        lambda: f"{without}{key}: !!binary aGVsbG8=\n",
        lambda: f"{without}{key}: !!set {{a, b}}\n",
        lambda: f"{without}{key}: !!omap [a: 1]\n",
        lambda: f"{without}{key}: 2026-11-22 10:00:00\n",
        lambda: f"{without}{key}: {'9' * 5000}\n",
        lambda: f"{without}{key}: 190:20:30\n",
        lambda: f"{without}{key}: {'[' * 3000}\n",
        lambda: f"{without}{key}: {'[' * 3000}{']' * 3000}\n",
        lambda: f"{without}? [a, b]\n: 1\n",
        lambda: f"{text}---\n{text}",
        lambda: f"[{key}]\n",
        lambda: "",
        lambda: "# only a comment\n",
        lambda: "just text\n",
        lambda: text.replace("  ", "\t"),
        lambda: text.replace(": ", ":"),
    ))().encode()  # fmt: skip


def damage_bytes(content: bytes, rng: random.Random) -> bytes:
    """Truncated, spliced, with other characters or bytes, with lines doubled or missing."""
    at = rng.randrange(len(content))
    lines = content.splitlines(keepends=True)
    n = rng.randrange(len(lines))
    return rng.choice((
        lambda: content[:at],
        lambda: content[:at],
        lambda: content[:at] + rng.choice(CHARACTERS).encode() + content[at + 1 :],
        lambda: content[:at] + rng.choice(CHARACTERS).encode() * rng.randrange(1, 40) + content[at:],
        lambda: content[:at] + rng.randbytes(rng.randrange(1, 30)) + content[at:],
        lambda: content[:at] + content[at + rng.randrange(1, 60) :],
        lambda: bytes(b ^ (1 << rng.randrange(8)) if i == at else b for i, b in enumerate(content)),
        lambda: b"".join([*lines[:n], *lines[n + 1 :]]),
        lambda: b"".join([*lines[:n], lines[n], *lines[n:]]),
        lambda: b"".join(rng.sample(lines, len(lines))),
        lambda: rng.randbytes(rng.randrange(0, 2000)),
        lambda: content.decode(errors="replace").encode("utf-16"),
        lambda: content.decode(errors="replace").encode("utf-32"),
    ))()  # fmt: skip


def damage_numbers(content: bytes, rng: random.Random) -> bytes:
    """One number of a text file replaced by something else."""
    text = content.decode()
    spans, start = [], None
    for i, character in enumerate(text + "\n"):
        if character in "0123456789.-+eE":
            start = i if start is None else start
        elif start is not None:
            if any(c.isdigit() for c in text[start:i]):
                spans.append((start, i))
            start = None
    begin, end = rng.choice(spans or [(0, len(text))])
    return (text[:begin] + rng.choice(NUMBERS) + text[end:]).encode()


def _flow(values: dict) -> str:
    return yaml.dump(values, Dumper=yaml.CSafeDumper, sort_keys=False, allow_unicode=True, default_flow_style=True)


def _reordered(values: dict) -> dict:
    return dict(reversed(values.items()))


NEUTRAL_YAML: tuple[Callable[[dict], bytes], ...] = (
    lambda values: yaml_text(_reordered(values)).encode(),
    lambda values: _flow(values).encode(),
    lambda values: yaml_text(values).replace("\n", "\r\n").encode(),
    lambda values: ("# a comment\n---\n" + yaml_text(values) + "# and another\n...\n").encode(),
    lambda values: b"\xef\xbb\xbf" + yaml_text(values).encode(),
    lambda values: yaml.dump(values, Dumper=yaml.CSafeDumper, sort_keys=False, allow_unicode=False, indent=6).encode(),
)
"""Other ways to write the same mapping: the order at the top, flow style, line ends, comments, a byte order mark, escapes."""
