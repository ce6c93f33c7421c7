"""Small faults that can be planted in a Python source: each replaces the text of one expression, the rest stays as it is.

Kinds: ``sign`` (+ for -, a minus dropped), ``comparison`` (negated; where whole numbers are compared, also its limit moved by
one), ``one`` (an integer one larger), ``term`` (the second term of a sum dropped), ``condition`` (an operand of and/or, a `not`
or the condition of an `if` dropped), ``factor`` (a constant factor or the conversion of an angle dropped) and ``arguments`` (the
first two of a call swapped).

Left as they are: docstrings, annotations, decorators, defaults of parameters, log lines, formatted texts, what is raised or
asserted; by ``one`` also constants of modules and classes: nothing says that five is right and six is wrong.
"""

from __future__ import annotations

import ast
import contextlib
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate

KINDS = ("sign", "comparison", "one", "term", "condition", "factor", "arguments")

NEGATED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "==", "is": "is not", "is not": "is", "in": "not in",
           "not in": "in"}  # fmt: skip
MOVED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}  # of whole numbers
OPERATORS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.Is: "is",
             ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in"}  # fmt: skip
SYMMETRIC = {"max", "min", "maximum", "minimum", "fmax", "fmin", "hypot", "gcd", "isclose", "allclose", "array_equal",
             "isinstance"}  # fmt: skip
ANGLES = {"radians", "degrees", "deg2rad", "rad2deg"}
LOG_CALLS = {"debug", "info", "warning", "warn", "error", "exception", "critical", "log"}
TUNING = {"indent", "stacklevel", "maxsize", "depth", "timeout", "timeout_s", "chunksize", "max_workers", "linewidth", "fontsize"}


@dataclass(frozen=True)
class Mutant:
    """One fault: bytes ``start`` to ``end`` of the file ``path`` become ``text``; ``before`` and ``after`` are its lines."""

    path: str
    line: int
    kind: str
    start: int
    end: int
    text: str
    before: str
    after: str
    function: str  # qualified name of the outermost function that it lies in; empty outside of functions

    def applied(self, source: bytes) -> bytes:
        """The file with the fault in it."""
        return source[: self.start] + self.text.encode() + source[self.end :]


def draw(path: str, source: bytes, count: int, seed: int) -> list[Mutant]:
    """Up to ``count`` faults of different expressions, kinds taken in turn; the same for the same file and seed."""
    generator = random.Random(f"{seed}:{path}")
    by_kind: dict[str, list[Mutant]] = {}
    for mutant in mutants(path, source):
        by_kind.setdefault(mutant.kind, []).append(mutant)
    kinds = [kind for kind in KINDS if kind in by_kind]
    generator.shuffle(kinds)
    for kind in kinds:
        generator.shuffle(by_kind[kind])
    chosen: list[Mutant] = []
    while len(chosen) < count and any(by_kind.values()):
        for kind in kinds:
            while by_kind[kind]:
                one = by_kind[kind].pop()
                if all((one.start, one.end) != (other.start, other.end) for other in chosen) and _is_python(one.applied(source)):
                    chosen.append(one)
                    break
    return sorted(chosen[:count], key=lambda m: m.start)


def mutants(path: str, source: bytes) -> list[Mutant]:
    """All faults that can be planted in a file, in order."""
    finder = _Finder(path, source)
    finder.visit(ast.parse(source))
    return finder.found


def _is_python(source: bytes) -> bool:
    with contextlib.suppress(SyntaxError):
        return bool(ast.parse(source))
    return False


class _Finder:
    def __init__(self, path: str, source: bytes):
        self._path, self._source = path, source
        self._lines = [0, *accumulate(len(line) for line in source.splitlines(keepends=True))]
        self._names, self._outermost = list[str](), ""
        self.found: list[Mutant] = []

    def visit(self, node: ast.AST) -> None:
        for kind, at, text in self._faults(node):
            self._keep(kind, at, text)
        for child in _mutable_children(node):
            self._descend(node, child)

    def _descend(self, node: ast.AST, child: ast.AST) -> None:
        names, outermost = list(self._names), self._outermost
        if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            self._names.append(child.name)
            if not isinstance(child, ast.ClassDef) and not self._outermost:
                self._outermost = ".".join(self._names)
        self.visit(child)
        self._names, self._outermost = names, outermost

    def _keep(self, kind: str, at: tuple[int, int], text: str) -> None:
        start, end = at
        first = self._source.rfind(b"\n", 0, start) + 1
        last = self._source.find(b"\n", end)
        before = self._source[first:last].decode()
        after = (self._source[first:start] + text.encode() + self._source[end:last]).decode()
        line = self._source.count(b"\n", 0, start) + 1
        self.found.append(Mutant(self._path, line, kind, start, end, text, _joined(before), _joined(after), self._outermost))

    def _faults(self, node: ast.AST) -> Iterator[tuple[str, tuple[int, int], str]]:
        """Kind, place and new text of each fault of one expression."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            yield "sign", self._at(node), self._operand(node.operand)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield "condition", self._at(node), self._operand(node.operand)
        elif isinstance(node, ast.BinOp):
            yield from self._of_sums_and_products(node)
        elif isinstance(node, ast.AugAssign) and isinstance(node.op, (ast.Add, ast.Sub)) and not _is_text(node.value):
            plus, minus = ("+=", "-=") if isinstance(node.op, ast.Add) else ("-=", "+=")
            yield from self._replaced("sign", self._between(node.target, node.value), plus, minus)
        elif isinstance(node, ast.Compare) and len(node.ops) == 1:
            yield from self._of_comparisons(node)
        elif isinstance(node, ast.BoolOp):
            for left_out in range(len(node.values)):
                word = " and " if isinstance(node.op, ast.And) else " or "
                kept = [self._operand(v) for i, v in enumerate(node.values) if i != left_out]
                yield "condition", self._at(node), kept[0] if len(kept) == 1 else "(" + word.join(kept) + ")"
        elif isinstance(node, ast.IfExp):
            yield "condition", self._at(node), self._operand(node.body)
        elif isinstance(node, ast.If) and not node.orelse and not isinstance(node.test, (ast.BoolOp, ast.Compare)):
            yield "condition", self._at(node.test), "True"
        elif isinstance(node, ast.Constant) and type(node.value) is int and self._outermost:
            yield "one", self._at(node), str(node.value + 1)
        elif isinstance(node, ast.Call):
            yield from self._of_calls(node)

    def _of_sums_and_products(self, node: ast.BinOp) -> Iterator[tuple[str, tuple[int, int], str]]:
        if isinstance(node.op, (ast.Add, ast.Sub)) and not _is_text(node.left) and not _is_text(node.right):
            plus, minus = ("+", "-") if isinstance(node.op, ast.Add) else ("-", "+")
            yield from self._replaced("sign", self._between(node.left, node.right), plus, minus)
            yield "term", self._at(node), self._operand(node.left)
        elif isinstance(node.op, (ast.Mult, ast.Div)) and not _is_text(node.left):
            if _is_number(node.right):
                yield "factor", self._at(node), self._operand(node.left)
            elif _is_number(node.left) and isinstance(node.op, ast.Mult):
                yield "factor", self._at(node), self._operand(node.right)

    def _of_comparisons(self, node: ast.Compare) -> Iterator[tuple[str, tuple[int, int], str]]:
        operator, where = OPERATORS[type(node.ops[0])], self._between(node.left, node.comparators[0])
        yield from self._replaced("comparison", where, operator, NEGATED[operator])
        if operator in MOVED and (_is_whole(node.left) or _is_whole(node.comparators[0])):
            yield from self._replaced("comparison", where, operator, MOVED[operator])

    def _of_calls(self, node: ast.Call) -> Iterator[tuple[str, tuple[int, int], str]]:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in ANGLES and len(node.args) == 1:
            yield "factor", self._at(node), self._operand(node.args[0])
        if len(node.args) >= 2 and name not in SYMMETRIC and not any(isinstance(a, ast.Starred) for a in node.args[:2]):
            first, second = self._text(self._at(node.args[0])), self._text(self._at(node.args[1]))
            if first != second:
                at = self._at(node.args[0])[0], self._at(node.args[1])[1]
                yield "arguments", at, second + self._text(self._between(node.args[0], node.args[1])) + first

    def _replaced(self, kind: str, where: tuple[int, int], old: str, new: str) -> Iterator[tuple[str, tuple[int, int], str]]:
        pattern = r"\b" + old.replace(" ", r"\s+") + r"\b" if old[0].isalpha() else re.escape(old)
        hit = None if "#" in self._text(where) else re.search(pattern, self._text(where))
        if hit:
            yield kind, (where[0] + hit.start(), where[0] + hit.end()), new

    def _at(self, node: ast.AST) -> tuple[int, int]:
        return (self._lines[node.lineno - 1] + node.col_offset, self._lines[node.end_lineno - 1] + node.end_col_offset)  # type: ignore[attr-defined]

    def _between(self, left: ast.AST, right: ast.AST) -> tuple[int, int]:
        return self._at(left)[1], self._at(right)[0]

    def _text(self, at: tuple[int, int]) -> str:
        return self._source[at[0] : at[1]].decode()

    def _operand(self, node: ast.AST) -> str:
        """Its text, in brackets where it is not of one piece."""
        text = self._text(self._at(node))
        return text if isinstance(node, (ast.Name, ast.Attribute, ast.Call, ast.Constant, ast.Subscript)) else f"({text})"


def _mutable_children(node: ast.AST) -> Iterator[ast.AST]:
    """The parts of a syntax node that faults may be planted in."""
    skipped: list[ast.AST | None] = []
    if isinstance(node, (ast.Raise, ast.Assert, ast.JoinedStr)) or _is_log_line(node) or _is_guard(node):
        return
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
        skipped = [node.returns, *node.decorator_list]
    elif isinstance(node, ast.arguments):
        skipped = [*node.defaults, *node.kw_defaults]
    elif isinstance(node, ast.ClassDef):
        skipped = [*node.decorator_list, *node.bases]
    elif isinstance(node, (ast.AnnAssign, ast.arg)):
        skipped = [node.annotation]
    elif isinstance(node, ast.keyword) and node.arg in TUNING:
        return
    elif isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets):
        return
    for child in ast.iter_child_nodes(node):
        if not any(child is one for one in skipped):
            yield child


def _is_log_line(node: ast.AST) -> bool:
    if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) and isinstance(node.value.func, ast.Attribute)):
        return False
    return node.value.func.attr in LOG_CALLS and "log" in ast.unparse(node.value.func.value).lower()


def _is_guard(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and any(word in ast.unparse(node.test) for word in ("TYPE_CHECKING", "__name__"))


def _is_text(node: ast.AST) -> bool:
    """Whether a sum of it is text or a list."""
    if isinstance(node, ast.BinOp):
        return _is_text(node.left) or _is_text(node.right)
    if isinstance(node, ast.Constant):
        return isinstance(node.value, (str, bytes))
    return isinstance(node, (ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp))


def _is_number(node: ast.AST) -> bool:
    """A constant factor: a thousand, a half, pi."""
    return getattr(node, "attr", "") == "pi" or (isinstance(node, ast.Constant) and type(node.value) in (int, float))


def _is_whole(node: ast.AST) -> bool:
    """Whether it is seen to be a whole number."""
    if isinstance(node, ast.Constant):
        return type(node.value) is int
    text = ast.unparse(node)
    return text.startswith("len(") or text.endswith((".size", ".ndim")) or ".shape[" in text


def _joined(text: str) -> str:
    return " ".join(text.split())
