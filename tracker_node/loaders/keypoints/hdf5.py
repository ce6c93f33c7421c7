"""HDF5 files read with care: sizes before contents, nothing that lies in other files, no pickled objects but names.

Lists, tuples, text and numbers in the form in which Python programs keep objects, read without making any object else.

PyTables writes names of columns so. Python's own reader would look up and call what the bytes name; here they are only listed,
and whatever is not plain is refused.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from pickletools import genops
from typing import Any

import numpy as np

from ...errors import FileFormatError, extra_module
from ..whole_file import MB, TABLE_BYTES, check_regular

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HEAP, _HEAP_HEADER = b"GCOL\x01\0\0\0", 16  # of a collection of texts; of it and of each text in it
_MOST_TEXTS = 100_000
_DAMAGED = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, MemoryError, OverflowError, UnicodeError)


class Hdf5File:
    """An open file; its errors name path and dataset.

    Parameters
    ----------
    path : of the file.
    root : open ``h5py.File``.
    """

    def __init__(self, path: Path, root: Any):
        self.path, self._root = path, root

    def keys(self) -> tuple[str, ...]:
        """Names at the top."""
        return tuple(str(key) for key in self._root)

    def has(self, name: str) -> bool:
        """Whether there is a dataset of that name in the file itself."""
        return self._find(name) is not None

    def array(self, name: str) -> np.ndarray:
        """A dataset.

        Raises
        ------
        FileFormatError : it is missing, or larger than `TABLE_BYTES`.
        """
        found = self._find(name)
        if found is None:
            raise FileFormatError(self.path, name, "a dataset", "none")
        n_bytes = int(found.size or 0) * int(found.dtype.itemsize)
        if n_bytes > TABLE_BYTES:
            raise FileFormatError(self.path, name, f"at most {TABLE_BYTES // MB} MB", f"{n_bytes // MB} MB")
        return np.asarray(found[()])

    def numbers(self, name: str, n_axes: int) -> np.ndarray:
        """A dataset of numbers.

        Parameters
        ----------
        name, n_axes : of the dataset.

        Returns
        -------
        float64, which may have NaN.

        Raises
        ------
        FileFormatError : it is missing, has other axes, or holds no numbers.
        """
        array = self.array(name)
        if array.dtype.kind not in "fiu" or array.ndim != n_axes:
            raise FileFormatError(self.path, name, f"numbers along {n_axes} axes", f"{array.dtype} {array.shape}")
        return array.astype(np.float64)

    def names(self, name: str) -> tuple[str, ...]:
        """A dataset of text.

        Raises
        ------
        FileFormatError : it is missing, or holds something else.
        """
        dataset = self._find(name)
        loose = dataset is not None and dataset.dtype.kind == "O"
        cells = self._texts(dataset, name) if loose else self.array(name).ravel().tolist()
        found = [each.decode("utf-8", "replace") if isinstance(each, bytes) else each for each in cells]
        if not all(isinstance(each, str) for each in found):
            raise FileFormatError(self.path, name, "names", found[:5])
        return tuple(str(each) for each in found)

    def attribute(self, group: str, name: str) -> Any:
        """An attribute that PyTables has written: lists, tuples, text and numbers, no other objects; None where there is none.

        Parameters
        ----------
        group, name : group or dataset; its attribute.

        Returns
        -------
        Plain values.

        Raises
        ------
        FileFormatError : it stands for other objects, whose reading could run a program.
        """
        value = self._root[group].attrs.get(name)
        if not isinstance(value, (bytes, np.bytes_)):
            return value
        try:
            return plain_value(bytes(value))
        except ValueError as error:
            raise FileFormatError(self.path, f"{group}.{name}", "names in plain lists", str(error)) from None

    def _texts(self, dataset: Any, name: str) -> list[bytes]:
        """Texts of any length, each a reference into a heap; the library itself hangs or dies where these are damaged."""
        at, n = dataset.id.get_offset(), int(dataset.size or 0)
        if at is None or n > _MOST_TEXTS:
            expected = f"at most {_MOST_TEXTS} names, not in chunks"
            raise FileFormatError(self.path, name, expected, f"{n} names, chunks of {dataset.chunks}")
        with open(self.path, "rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            try:
                cells = [struct.unpack_from("<IQI", content, at + 16 * i) for i in range(n)]
                heaps = {address: _heap_texts(content, address) for address in {address for _, address, _ in cells}}
                return [heaps[address][number][:length] for length, address, number in cells]
            except (struct.error, KeyError, ValueError, OverflowError) as error:
                raise FileFormatError(self.path, name, "names in a sound HDF5 file", str(error)) from None

    def _find(self, name: str) -> Any | None:
        """A dataset that lies in the file itself; None where there is none."""
        from h5py import Dataset, ExternalLink

        place = ""
        for part in name.split("/"):
            place = f"{place}/{part}"
            link = self._root.get(place, getlink=True)
            if link is None:
                return None
            if isinstance(link, ExternalLink):
                raise FileFormatError(self.path, place, "data in the file itself", "a link to another file")
        found = self._root.get(name)
        if not isinstance(found, Dataset):
            return None
        if found.is_virtual or found.external:
            raise FileFormatError(self.path, name, "data in the file itself", "data in another file")
        return found


def _heap_texts(content: mmap.mmap, address: int) -> dict[int, bytes]:
    """Number -> text of a collection."""
    if content[address : address + 8] != _HEAP:
        raise ValueError(f"no collection of texts at {address}")
    end = min(address + struct.unpack_from("<Q", content, address + 8)[0], len(content))
    texts, inside = {}, address + _HEAP_HEADER
    while inside + _HEAP_HEADER <= end:
        number, size = struct.unpack_from("<H6xQ", content, inside)
        if number == 0:  # the rest is free
            break
        if inside + _HEAP_HEADER + size > end:
            raise ValueError(f"a text of {size} bytes at {inside}")
        texts[number] = content[inside + _HEAP_HEADER : inside + _HEAP_HEADER + size]
        inside += _HEAP_HEADER + -(-size // 8) * 8
    return texts


@contextmanager
def open_hdf5(path: str | Path) -> Iterator[Hdf5File]:
    """A file, read only.

    Parameters
    ----------
    path : of the file.

    Yields
    ------
    The open file.

    Raises
    ------
    MissingExtraError : h5py is not installed.
    FileFormatError : it is missing, too large, or no sound HDF5.
    """
    check_regular(path, TABLE_BYTES)
    h5py = extra_module("h5py", "h5")
    try:
        with h5py.File(path, "r") as root:
            yield Hdf5File(Path(path), root)
    except _DAMAGED as error:
        raise FileFormatError(path, "(file)", "an HDF5 file", str(error)) from None


def is_hdf5(path: str | Path) -> bool:
    """Whether a file begins as those of HDF5 do."""
    with open(path, "rb") as stream:
        return stream.read(len(SIGNATURE)) == SIGNATURE


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
