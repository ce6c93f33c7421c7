"""The decorator of all compiled functions, and what their machine code is kept by.

numba keeps machine code beside the source file of a function, and takes it for fresh until that file changes. But a function is
compiled together with those that it calls, and with constants of other modules; so here it is kept by the content of all of them,
in a file whose name says which.
"""

from __future__ import annotations

import gc
import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba as nb
import numpy as np
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher

_ROOT = __name__.partition(".")[0]


def compiled(function: Callable | None = None, **options: Any) -> Any:
    """Decorator of a function that is compiled when it is first called with arguments of some types.

    It runs without the interpreter's lock, and divides as numpy does. C cannot call it, which nobody does, and spares a tenth of
    the time of compiling.

    Parameters
    ----------
    function : that is compiled; None: the decorator is called with ``options`` first.
    **options : of `numba.njit`.

    Returns
    -------
    A numba dispatcher; a decorator where there is no function.
    """
    if function is None:
        return lambda other: compiled(other, **options)
    all_options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    dispatcher: Any = nb.njit(**all_options)(function)
    dispatcher._cache = _ContentCache(function)
    return dispatcher


def is_kept(dispatcher: Any, types: tuple) -> bool:
    """Whether there is machine code of a compiled function already.

    Parameters
    ----------
    dispatcher, types : of `compiled`; numba types of its arguments.

    Returns
    -------
    It is not loaded.
    """
    return types in dispatcher.overloads or dispatcher._cache.has(types, dispatcher.targetctx.codegen())


class _ContentCache(FunctionCache):
    """Machine code by the content of a function and of all that it uses."""

    def __init__(self, function: Callable):
        super().__init__(function)
        self._cache_file: _FileEach = _FileEach(self._cache_path, self._impl.filename_base, Path(function.__code__.co_filename))

    def _index_key(self, sig: Any, codegen: Any) -> tuple:
        return (*super()._index_key(sig, codegen), content_of(self._py_func))

    def has(self, types: tuple, codegen: Any) -> bool:
        """Whether there is machine code for arguments of some types; it is not loaded."""
        return self._cache_file.path_of(self._index_key(types, codegen)).exists()


class _FileEach(IndexDataCacheFile):
    """One file for each key, and no index.

    numba numbers the files of a function and keeps an index of them. Two processes that keep something of the same name at once,
    as `ahead` has them do with functions that one factory has made, give both the same number: one is then called for the other.
    """

    def __init__(self, folder: str, name: str, source: Path):
        super().__init__(folder, name, None)
        self._folder, self._name, self._source = Path(folder), name, source

    def path_of(self, key: tuple) -> Path:
        """Where the machine code of a key is, or would be. Types of arguments are told apart by how they are written."""
        digest = hashlib.sha256(repr((self._version, key)).encode()).hexdigest()[:32]
        return self._folder / f"{self._name}.{digest}.nbc"

    def save(self, key: tuple, data: Any) -> None:
        self._save_data(self.path_of(key).name, data)
        with suppress(FileNotFoundError):  # another process removes them, too
            changed = self._source.stat().st_mtime
            for other in self._folder.glob(f"{self._name}.*.nbc"):
                if other.stat().st_mtime < changed:
                    other.unlink()

    def load(self, key: tuple) -> Any:
        try:
            return self._load_data(self.path_of(key).name)
        except FileNotFoundError:
            return None

    def flush(self) -> None:
        pass


@cache
def content_of(function: FunctionType) -> str:
    """Digest of a function's code and of what it takes from the package: functions, constants, and their own.

    Parameters
    ----------
    function : a Python function, as it was before it was compiled; it must not call itself.

    Returns
    -------
    Hexadecimal.
    """
    digest = hashlib.sha256()
    _add_code(digest, function.__code__, function.__globals__)
    for cell in function.__closure__ or ():
        _add(digest, cell.cell_contents)
    return digest.hexdigest()


def _add(digest: Any, value: Any) -> None:
    if isinstance(value, Dispatcher):
        for name, option in sorted(value.targetoptions.items()):
            _add(digest, (name, getattr(option, "flags", option)))
        value = value.py_func
    if isinstance(value, FunctionType):
        ours = value.__module__.startswith(_ROOT)
        digest.update((content_of(value) if ours else value.__qualname__).encode())
    elif isinstance(value, np.ndarray):
        digest.update(value.tobytes() + repr((value.shape, value.dtype)).encode())
    elif isinstance(value, tuple | list):
        for each in value:
            _add(digest, each)
    elif isinstance(value, set | frozenset):  # whose order changes from run to run
        digest.update(repr(sorted(map(repr, value))).encode())
    elif not isinstance(value, ModuleType | type):
        digest.update(repr(value).encode())


def _add_code(digest: Any, code: CodeType, names: dict[str, Any]) -> None:
    digest.update(code.co_code)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            _add_code(digest, constant, names)
        else:
            _add(digest, constant)
    for name in code.co_names:
        digest.update(name.encode())
        value = names.get(name)
        if isinstance(value, ModuleType):
            if value.__name__.startswith(_ROOT):  # what is taken from it is among the names, too
                for other in code.co_names:
                    _add(digest, getattr(value, other, None))
        elif value is not None:
            _add(digest, value)


class _WithoutCollection(event.Listener):
    """No garbage is collected while code is compiled, one function within another: it makes millions of objects, and little
    garbage. A seventh of the time."""

    def __init__(self) -> None:
        self._depth, self._was_on = 0, False

    def on_start(self, event: Any) -> None:
        if not self._depth:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if not self._depth and self._was_on:
            gc.enable()


event.register("numba:compile", _WithoutCollection())
