"""What has been digitized: clicks on points in many image sets, saved as they are made.

The folder has ``first/STAMP_NS.csv``, ``second/...`` (the same images digitized again), clicks of `loaders.rig.control_points`,
``control_points.csv`` for `calibrate dlt`, and ``points.txt``, the names of points that are no landmarks.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ...loaders.owned_folder import OwnedFolder
from ...loaders.rig.control_points import ControlPoints, dump_clicks, dump_control_points, load_clicks, load_control_points
from ...loaders.whole_file import read_text

PASSES = ("first", "second", "third")
CONTROL_FILE, NAMES_FILE = "control_points.csv", "points.txt"
_LONGEST_NAME = 60

Clicked = dict[str, dict[str, np.ndarray]]
"""Camera -> point -> pixel (2,)."""


class ClickStore:
    """Clicks in memory, and the same in a folder.

    Parameters
    ----------
    path : of the folder; what is there already is loaded.
    cameras : their names.
    places : point -> its known place (3,), meters in the world.

    Raises
    ------
    FileFormatError : a file that is there and cannot be read, a camera that the rig has not, another place of a control point.
    """

    def __init__(self, path: str | Path, cameras: tuple[str, ...], places: dict[str, np.ndarray] | None = None):
        self.folder = OwnedFolder(path)
        self.cameras = cameras
        self.places = dict(places or {})
        self.names: list[str] = []
        self.control: Clicked = {}
        self._passes: dict[str, dict[int, Clicked]] = {name: {} for name in PASSES}
        self._load()

    def clicked(self, pass_name: str, stamp_ns: int) -> Clicked:
        """Clicks on the images of one set; not to be changed.

        Parameters
        ----------
        pass_name : one of `PASSES`.
        stamp_ns : of the image set.

        Returns
        -------
        Empty where there are none.
        """
        return self._passes[pass_name].get(stamp_ns, {})

    def stamps_ns(self) -> list[int]:
        """Stamps of the image sets of which any pass has clicks, in order."""
        return sorted({stamp_ns for of_pass in self._passes.values() for stamp_ns, clicks in of_pass.items() if clicks})

    def clicked_names(self) -> list[str]:
        """Points that were clicked on anywhere, those of one's own first."""
        clicked = (points for of_pass in self._passes.values() for cameras in of_pass.values() for points in cameras.values())
        return list(dict.fromkeys([*self.names, *(name for points in clicked for name in points)]))

    def count(self, stamp_ns: int) -> int:
        """Clicks on the images of a set, of all passes."""
        return sum(len(points) for name in PASSES for points in self.clicked(name, stamp_ns).values())

    def set_click(self, pass_name: str, stamp_ns: int, camera: str, point: str, pixel: np.ndarray | None) -> None:
        """Put, move or delete a click; saved when this returns.

        Parameters
        ----------
        pass_name : one of `PASSES`.
        stamp_ns : of the image set.
        camera, point : names.
        pixel : (2,) u, v; None deletes.

        Raises
        ------
        FileFormatError : the file that holds them is not ours to replace.
        """
        changed = _changed(self.clicked(pass_name, stamp_ns), camera, point, pixel)
        name = f"{pass_name}/{stamp_ns}.csv"
        if changed:
            self.folder.write(name, lambda path: dump_clicks(changed, path))
        else:
            self.folder.remove(name)
        self._passes[pass_name][stamp_ns] = changed

    def set_control_click(self, camera: str, point: str, pixel: np.ndarray | None) -> None:
        """The same for a control point, of which a camera sees each once, in whichever image.

        Parameters
        ----------
        camera, point : names.
        pixel : (2,) u, v; None deletes.
        """
        changed = _changed(self.control, camera, point, pixel)
        if changed:
            self.folder.write(CONTROL_FILE, lambda path: dump_control_points(self.control_points(changed), path))
        else:
            self.folder.remove(CONTROL_FILE)
        self.control = changed

    def control_points(self, clicked: Clicked | None = None) -> dict[str, ControlPoints]:
        """Clicks on control points with their places."""
        chosen = self.control if clicked is None else clicked
        return {
            camera: ControlPoints(tuple(seen), np.array([self.places[name] for name in seen]), np.array(list(seen.values())))
            for camera, seen in chosen.items()
        }

    def add_name(self, name: str) -> None:
        """One more point of one's own.

        Raises
        ------
        FileFormatError : a name that files could not hold.
        """
        name = name.strip()
        if not name or len(name) > _LONGEST_NAME or not name.isprintable():
            raise FileFormatError("points", "name", f"1 to {_LONGEST_NAME} printable characters", name)
        if name not in self.names:
            names = [*self.names, name]
            self.folder.write(NAMES_FILE, lambda path: path.write_text("\n".join(names) + "\n", encoding="utf-8"))
            self.names = names

    def mean_clicks(self, stamp_ns: int) -> Clicked:
        """Mean of all passes, of one image set."""
        every = self.repeated(stamp_ns)
        return {camera: {point: np.mean(pixels, axis=0) for point, pixels in points.items()} for camera, points in every.items()}

    def repeated(self, stamp_ns: int) -> dict[str, dict[str, np.ndarray]]:
        """Camera -> point -> pixels (n, 2) of the passes that have it."""
        every: dict[str, dict[str, list[np.ndarray]]] = {}
        for name in PASSES:
            for camera, points in self.clicked(name, stamp_ns).items():
                for point, pixel in points.items():
                    every.setdefault(camera, {}).setdefault(point, []).append(pixel)
        return {camera: {point: np.array(pixels) for point, pixels in points.items()} for camera, points in every.items()}

    def _load(self) -> None:
        for name in PASSES:
            for path in sorted((self.folder.path / name).glob("*.csv")):
                self._passes[name][_stamp_of(path)] = self._known(path, load_clicks(path))
        if (self.folder.path / NAMES_FILE).exists():
            self.names = [name for name in read_text(self.folder.path / NAMES_FILE).splitlines() if name]
        path = self.folder.path / CONTROL_FILE
        if path.exists():
            self._load_control(path)

    def _load_control(self, path: Path) -> None:
        for camera, seen in load_control_points(path).items():
            for name, place, pixel in zip(seen.names, seen.points, seen.pixels, strict=True):
                known = self.places.setdefault(name, place)
                if not np.allclose(known, place, rtol=0.0, atol=1e-9):
                    raise FileFormatError(path, f"point '{name}'", f"the place known of it, {known.tolist()}", place.tolist())
                self.control.setdefault(camera, {})[name] = pixel
        self._known(path, self.control)

    def _known(self, path: Path, clicked: Clicked) -> Clicked:
        unknown = [camera for camera in clicked if camera not in self.cameras]
        if unknown:
            raise FileFormatError(path, "camera", f"one of {', '.join(self.cameras)}", unknown[0])
        return clicked


def _changed(clicked: Clicked, camera: str, point: str, pixel: np.ndarray | None) -> Clicked:
    """A copy with one click put, moved or deleted."""
    changed = {name: dict(points) for name, points in clicked.items()}
    points = changed.setdefault(camera, {})
    if pixel is None:
        points.pop(point, None)
    else:
        points[point] = np.asarray(pixel, dtype=np.float64)
    return {name: points for name, points in changed.items() if points}


def _stamp_of(path: Path) -> int:
    try:
        return int(path.stem)
    except ValueError:
        raise FileFormatError(path, "(name)", "STAMP_NS.csv, nanoseconds", path.name) from None
