"""CSV files whose numbers come back bit for bit, and whose errors name line and column."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..closing import Closing
from ..errors import FileFormatError
from .whole_file import TABLE_BYTES, read_text


class CsvWriter(Closing):
    """Rows to a CSV file, each handed to the operating system at once; usable in a ``with`` statement."""

    def __init__(self, path: str | Path, header: Sequence[str]):
        self.path = Path(path)
        self._stream = self.path.open("w", newline="", encoding="utf-8")
        self._writer = csv.writer(self._stream, lineterminator="\n")
        self._quoting = csv.writer(self._stream, lineterminator="\n", quoting=csv.QUOTE_ALL)
        self.write_rows([header])

    def write_rows(self, rows: Sequence[Sequence[Any]]) -> None:
        try:
            for row in rows:
                # A carriage return ends a line for every reader, but the writer quotes only what is in its own line's end
                returns = any(isinstance(cell, str) and "\r" in cell for cell in row)
                (self._quoting if returns else self._writer).writerow(row)
            self._stream.flush()
        except OSError as error:  # of a full disk, which says nothing of where
            error.filename = str(self.path)
            raise

    def close(self) -> None:
        if not self._stream.closed:
            self._stream.flush()
            os.fsync(self._stream.fileno())
            self._stream.close()


@dataclass(frozen=True)
class CsvCells:
    """One line of a file, with what an error message needs."""

    path: Path
    line: int
    header: tuple[str, ...]
    text: list[str] = field(repr=False)

    def _error(self, column: int, expected: str) -> FileFormatError:
        return FileFormatError(self.path, f"line {self.line}, column '{self.header[column]}'", expected, self.text[column])

    def integer(self, column: int) -> int:
        try:
            value = int(self.text[column])
        except ValueError:
            raise self._error(column, "an integer") from None
        if not -(2**63) <= value < 2**63:
            raise self._error(column, "an integer of 64 bits")
        return value

    def number(self, column: int) -> float:
        try:
            value = float(self.text[column])
        except ValueError:
            raise self._error(column, "a number") from None
        if not np.isfinite(value):
            raise self._error(column, "a finite number")
        return value

    def numbers(self, first: int, last: int) -> np.ndarray:
        """Finite numbers of neighboring columns.

        Parameters
        ----------
        first, last : columns, ``last`` exclusive.

        Returns
        -------
        (last - first,) float64.
        """
        return np.array([self.number(column) for column in range(first, last)])


class CsvTable:
    """A CSV file whose header has been read.

    Parameters
    ----------
    path : CSV file.
    columns : that it must begin with.

    Raises
    ------
    FileFormatError : other columns.
    """

    def __init__(self, path: str | Path, columns: Sequence[str] = ()):
        self.path = Path(path)
        text = read_text(self.path, TABLE_BYTES, unix_lines=False).removeprefix("\ufeff")  # which spreadsheets begin with
        self._lines = csv.reader(io.StringIO(text, newline=""))
        self.header: tuple[str, ...] = tuple(self._next() or ())
        if self.header[: len(columns)] != tuple(columns):
            raise FileFormatError(self.path, "header", f"columns starting with {','.join(columns)}", ",".join(self.header))

    def _next(self) -> list[str] | None:
        """The cells of the next line, None at the end."""
        try:
            return next(self._lines, None)
        except csv.Error as error:  # a field of more than 128 KB: mostly quotes that are opened and not closed
            raise FileFormatError(self.path, f"line {self._lines.line_num}", "a line of a CSV file", str(error)) from None

    def rows(self) -> Iterator[CsvCells]:
        while (text := self._next()) is not None:
            if not text:
                continue
            if len(text) != len(self.header):
                line = self._lines.line_num
                raise FileFormatError(self.path, f"line {line}", f"{len(self.header)} columns", f"{len(text)} columns")
            yield CsvCells(self.path, self._lines.line_num, self.header, text)


def exact(value: float) -> str:
    return format(float(value), ".17g")
