"""Lists, tuples, text and numbers in the form in which Python programs keep objects, read without making any object else.

PyTables writes names of columns so. Python's own reader would look up and call what the bytes name; here they are only listed,
and whatever is not plain is refused.
"""

from __future__ import annotations

from pickletools import genops
from typing import Any

_TEXTS_AND_NUMBERS = {
    "UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8", "STRING", "BINSTRING", "SHORT_BINSTRING", "INT", "BININT",
    "BININT1", "BININT2", "LONG", "LONG1", "FLOAT", "BINFLOAT",
}  # fmt: skip
_SIZED = {"EMPTY_TUPLE": 0, "TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}
_NOTHING = {"PROTO", "FRAME"}
_KEPT = {"PUT", "BINPUT", "LONG_BINPUT", "MEMOIZE"}
_FETCHED = {"GET", "BINGET", "LONG_BINGET"}


def plain_value(content: bytes) -> Any:
    """The value that bytes stand for.

    Raises
    ------
    ValueError : it is not plain, or the bytes are damaged.
    """
    reader = _Reader()
    try:
        for operation, argument, _ in genops(content):
            if operation.name == "STOP":
                return reader.stack.pop()
            reader.step(operation.name, argument)
    except (IndexError, KeyError, AttributeError, TypeError, OverflowError) as error:
        raise ValueError(f"damaged: {error!r}") from None
    raise ValueError("damaged: no end")


class _Reader:
    """The stack of values, with the values that are referred to again."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self._marks: list[int] = []
        self._kept: dict[int, Any] = {}

    def step(self, name: str, argument: Any) -> None:
        if name in _TEXTS_AND_NUMBERS:
            self.stack.append(argument)
        elif name == "NONE":
            self.stack.append(None)
        elif name == "MARK":
            self._marks.append(len(self.stack))
        elif name == "EMPTY_LIST":
            self.stack.append([])
        elif name == "LIST":
            self.stack.append(self._since_mark())
        elif name == "TUPLE":
            self.stack.append(tuple(self._since_mark()))
        elif name in _SIZED:
            at = len(self.stack) - _SIZED[name]
            if at < 0:
                raise IndexError(name)
            self.stack[at:] = [tuple(self.stack[at:])]
        elif name == "APPEND":
            value = self.stack.pop()
            self.stack[-1].append(value)
        elif name == "APPENDS":
            values = self._since_mark()
            self.stack[-1].extend(values)
        elif name in _KEPT:
            self._kept[len(self._kept) if argument is None else argument] = self.stack[-1]
        elif name in _FETCHED:
            self.stack.append(self._kept[argument])
        elif name not in _NOTHING:
            raise ValueError(f"an object ({name})")

    def _since_mark(self) -> list[Any]:
        at = self._marks.pop()
        values = self.stack[at:]
        del self.stack[at:]
        return values
