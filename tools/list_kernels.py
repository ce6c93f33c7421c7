#!/usr/bin/env python3
"""List the functions that a usual tracker compiles, callees first, in tracker_node/compiled/kernels.json.

A person is tracked by contours and points, from a given start and a searched one, and a box: in a process of its own, with an
empty cache, which takes a minute. To be run when `test/compiled/test_ahead.py` says that the list is old.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np


def main() -> int:
    if "NUMBA_CACHE_DIR" not in os.environ:
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
            return subprocess.run([sys.executable, __file__], env=environment, check=False).returncode
    from tracker_node.compiled.ahead import LIST

    rows = list(_rows(_compiled()))
    LIST.write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")
    print(f"{LIST}: {len(rows)} functions, {1e-3 * sum(row['ms'] for row in rows):.0f} s")
    return 0


def _compiled() -> list[tuple[Any, tuple, float]]:
    """Dispatchers, types and seconds of all that was compiled, in the order in which that was done."""
    from numba.core import event

    found, under_way = [], []

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            under_way.append([time.perf_counter(), 0.0])

        def on_end(self, event: Any) -> None:
            began, of_callees = under_way.pop()
            took = time.perf_counter() - began
            if under_way:
                under_way[-1][1] += took
            found.append((event.data["dispatcher"], tuple(event.data["args"]), took - of_callees))

    event.register("numba:compile", Listener())
    _track()
    return found


def _track() -> None:
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from benchmark.contour.box import rig_around
    from tracker_node.model.articulated import ArticulatedModel, Shape
    from tracker_node.model.humans.human import human_model
    from tracker_node.model.kinematic_chain import KinematicChain
    from tracker_node.model.shapes.primitives import Box
    from tracker_node.tracking import warm_up
    from tracker_node.tracking.config import from_dict

    warm_up.compile_ahead = lambda progress: 0  # by what was listed before
    rig = rig_around([(0.0, 15.0), (90.0, 15.0), (200.0, 15.0)], distance_m=3.5)
    box = Shape("box", "box", Box((0.3, 0.2, 0.1)), np.eye(4), (200, 60, 40))
    for model in (human_model(), ArticulatedModel("box", KinematicChain(("box",), ()), (box,))):
        for modalities in (["region"], ["region", "keypoints"])[: 2 if model.chain.n_axes else 1]:
            warm_up.warm_up(rig, model, from_dict({"modalities": modalities}))


def _rows(compiled: list[tuple[Any, tuple, float]]) -> Iterator[dict[str, Any]]:
    names, places = _names(), {}  # by dispatcher: its places in the list
    for dispatcher, types, seconds in compiled:
        if id(dispatcher) not in names:
            continue  # numba's own
        after = sorted(place for callee in _callees(dispatcher.py_func, set()) for place in places.get(id(callee), ()))
        places.setdefault(id(dispatcher), []).append(sum(map(len, places.values())))
        ms = round(1e3 * seconds)
        yield {"name": names[id(dispatcher)], "arguments": repr(types), "after": after, "ms": ms}


def _names() -> dict[int, str]:
    """What every compiled function is called, in the module in which it was made."""
    from numba.core.dispatcher import Dispatcher

    names = {}
    for module in [m for name, m in sys.modules.items() if name.startswith("tracker_node.")]:
        for name, value in vars(module).items():
            if isinstance(value, Dispatcher) and value.py_func.__module__ == module.__name__:
                names[id(value)] = f"{module.__name__.partition('.')[2]}:{name}"
    return names


def _callees(function: Any, seen: set[int]) -> Iterator[Any]:
    """Dispatchers that a function calls, and those of them that are compiled into it."""
    from numba.core.dispatcher import Dispatcher

    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    used = [function.__globals__.get(name) for name in function.__code__.co_names]
    modules = [value for value in used if isinstance(value, ModuleType)]
    used += [getattr(module, name, None) for module in modules for name in function.__code__.co_names]
    for value in [*used, *cells]:
        if isinstance(value, Dispatcher) and id(value) not in seen:
            seen.add(id(value))
            yield value
            yield from _callees(value.py_func, seen)


if __name__ == "__main__":
    sys.exit(main())
