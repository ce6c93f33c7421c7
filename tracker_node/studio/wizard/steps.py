"""The seven steps from videos to a report: what each has found, what it still needs, and the commands that it is.

A step writes files in the recording's folder, and is done while they are there and not older than what they were made from.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from ...calibration.video_pixels import KINDS
from ...calibration.world_frame import UP, up_of_cameras
from ...errors import FileFormatError, TrackerError, UnknownNameError
from ...loaders.images.source import open_camera_source
from ...loaders.rig.rig_yaml import load_rig
from .folder import Contents, contents_of, is_run

RIG, TIMED, WORLD, PERSON, START = "rig.yaml", "rig_timed.yaml", "rig_world.yaml", "person.yaml", "start.yaml"
RECORDING, RUN = "recording.yaml", "run"
DONE, TODO, OPTIONAL, WAITING = "done", "to do", "if needed", "not yet"
CHOICE, TEXT, NUMBER = "choice", "text", "number"
_BOARDS = ("charuco", "chessboard")
_COMPARED = ("contours and points", "contours")
_AXES = ("x", "-x", "y", "-y", "z", "-z")
_OF_RIG = "those of the rig"

Values = Mapping[str, str]


@dataclass(frozen=True)
class Field:
    """Something to be said. A choice of several has no value until somebody chooses; ``needed``: it must have one."""

    name: str
    label: str
    kind: str = CHOICE
    options: tuple[str, ...] = ()
    value: str = ""
    needed: bool = True


@dataclass(frozen=True)
class Way:
    """One of the ways in which a step can be done."""

    name: str
    label: str
    commands: Callable[[Values], list[list[str]]]
    fields: tuple[Field, ...] = ()


@dataclass(frozen=True)
class Step:
    """A step as it stands. ``said``: why, or what is needed; ``files``: what it has written that can be looked at."""

    name: str
    title: str
    state: str
    said: str
    ways: tuple[Way, ...] = ()
    found: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    links: dict[str, str] = field(default_factory=dict)

    def facts(self) -> dict[str, Any]:
        """As JSON."""
        ways = [{"name": way.name, "label": way.label, "fields": [vars(each) for each in way.fields]} for way in self.ways]
        return {**vars(self), "ways": ways}


class Steps:
    """The steps of a folder.

    Parameters
    ----------
    folder : of the recording.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self._contents: Contents = contents_of(folder)

    def all(self) -> list[Step]:
        """In their order."""
        return [step() for step in self._steps().values()]

    def _steps(self) -> dict[str, Callable[[], Step]]:
        return {
            "rig": self._rig, "time": self._time, "world": self._world, "body": self._body, "start": self._start,
            "run": self._run, "look": self._look,
        }  # fmt: skip

    def commands(self, name: str, way: str, values: Values) -> list[list[str]]:
        """Verb and arguments of what a step is.

        Parameters
        ----------
        name, way : of the step, and how it is to be done.
        values : of the way's fields; others have their own.

        Returns
        -------
        One or more, to be run in the folder.

        Raises
        ------
        TrackerError : no such step or way, one before its time, or a value that is missing or none of the options.
        """
        if name not in self._steps():
            raise UnknownNameError("step", name, self._steps())
        step = self._steps()[name]()
        if step.state == WAITING:
            raise TrackerError(f"{step.title.lower()}: {step.said}")
        ways = {each.name: each for each in step.ways}
        if way not in ways:
            raise UnknownNameError("way", way, ways)
        known = {each.name: each for each in ways[way].fields}
        for given in values:
            if given not in known:
                raise UnknownNameError("field", given, known)
        return ways[way].commands({name: _checked(each, values.get(name, each.value)) for name, each in known.items()})

    def shown(self, commands: Sequence[Sequence[str]]) -> list[str]:
        """Commands as a user types them in the folder."""
        return [f"tracker_node {shlex.join(command)}" for command in commands]

    def current_rig(self) -> str | None:
        """The rig that later steps go by: the last of the chain that is not older than what it was made from."""
        found = RIG if self._has(RIG) else None
        for later in (TIMED, WORLD):
            if found is not None and self._is_new(later, found):
                found = later
        return found

    def current_run(self) -> str:
        """The folder of the run that was made last, or of the first."""
        found = [path for path in self.folder.glob("run*/run.json") if is_run(path.parent)]
        return max(found, key=lambda path: path.stat().st_mtime_ns).parent.name if found else RUN

    def known_places(self) -> str | None:
        """Of points to be clicked on: the file that the page Points goes by."""
        return next(iter(self._contents.places), None)

    def _has(self, name: str) -> bool:
        return (self.folder / name).is_file()

    def _is_new(self, name: str, *made_from: str) -> bool:
        """Whether a file is there, and not older than others."""
        if not self._has(name):
            return False
        when = (self.folder / name).stat().st_mtime_ns
        return all(self._has(other) and (self.folder / other).stat().st_mtime_ns <= when for other in made_from)

    def _state(self, name: str, *made_from: str) -> str:
        return DONE if self._is_new(name, *made_from) else TODO

    def _anew(self, *names: str) -> list[str]:
        """``--force`` where a command would overwrite what an earlier one has written."""
        return ["--force"] if any((self.folder / name).exists() for name in names) else []

    def _older(self, name: str, *made_from: str) -> str:
        newer = [other for other in made_from if self._has(other) and not self._is_new(name, other)]
        return f"{name} is older than {', '.join(newer)}: do it again" if self._has(name) and newer else ""

    def _rig(self) -> Step:
        here, title = self._contents, "Rig"
        if self._has(RIG):
            try:
                found = self._cameras(RIG)
            except TrackerError as error:
                return Step("rig", title, TODO, str(error), self._rig_ways(), files=self._there("rig.html"))
            cameras = f"{len(found)} camera{'s' if len(found) > 1 else ''}"
            said = "; ".join([f"{RIG}: {cameras}", *(f"{name} is of none of them" for name in self._unused())])
            return Step("rig", title, DONE, said, self._rig_ways(), found, self._there("rig.html"))
        if not here.recordings:
            said = "no videos in this folder, and no folders of images: put those of every camera here"
            return Step("rig", title, WAITING, said)
        if not here.calibrations:
            said = "no calibration of another program here: film a board, or put a calibration here"
            more = f"; {', '.join(here.rigs)} may be named {RIG}" if here.rigs else ""
            return Step("rig", title, TODO, said + more, self._rig_ways())
        several = f"{len(here.calibrations)} calibrations here: choose" if len(here.calibrations) > 1 else "a calibration is here"
        return Step("rig", title, TODO, several, self._rig_ways(), here.calibrations)

    def _rig_ways(self) -> tuple[Way, ...]:
        here = self._contents
        folders = tuple(here.recordings)
        boards = tuple(name for name in folders if _is_board(name))
        filmed = tuple(name for name in folders if name not in boards)
        videos = Field("videos", "videos of the recording, in", options=folders, value=_only(filmed))
        backgrounds = Field("backgrounds", "backgrounds", options=("find or make them", "none"), value="find or make them")
        pixels = Field("pixel_map", f"how videos were resized (CAMERA=KIND: {', '.join(KINDS)})", TEXT, needed=False)
        board = Field("board", "the board, filmed by all, in", options=folders, value=_only(boards))
        ways = []
        if here.calibrations:
            calibration = Field("calibration", "calibration", options=here.calibrations, value=_only(here.calibrations))
            unit = Field("unit", "its unit", options=("as it says", "m", "cm", "mm"), value="as it says")
            of_import = (calibration, unit, videos, pixels, backgrounds)
            ways.append(Way("import", "a calibration that lies here", self._import, of_import))
        clocks = Field("clocks", "clocks", options=("auto", "sound", "exact", "offset", "free"), value="auto")
        fields = (board, *_board_fields(), clocks, videos, pixels, backgrounds)
        return (*ways, Way("board", "a board that all have filmed", self._board, fields))

    def _import(self, values: Values) -> list[list[str]]:
        unit = [] if values["unit"] == "as it says" else ["--unit", values["unit"]]
        rig = ["rig", "import", values["calibration"], "--sources", values["videos"], *unit, *_pixels(values)]
        return [[*rig, "-o", RIG, *self._anew(RIG)], *self._backgrounds(values)]

    def _board(self, values: Values) -> list[list[str]]:
        films = self._contents.recordings[values["board"]]
        rig = ["calibrate", "rig", "--videos", *films, *_board(values), "--clocks", values["clocks"]]
        rig += ["--sources", values["videos"], *_pixels(values), "-o", RIG]
        return [[*rig, *self._anew(RIG, "rig.html", "rig.json")], *self._backgrounds(values)]

    def _backgrounds(self, values: Values) -> list[list[str]]:
        return [] if values["backgrounds"] == "none" else [["calibrate", "background", "--rig", RIG, "-o", RIG, "--force"]]

    def _time(self) -> Step:
        title = "Time"
        if not self._has(RIG):
            return Step("time", title, WAITING, f"needs a rig: {RIG}")
        offset = Field("max_offset", "largest offset, s", NUMBER, value="2")
        at = Field("at", "where the clap was, x y z in meters", TEXT, needed=False)
        labels = {
            "motion": "what moves", "sound": "claps in the sound", "flash": "flashes", "blinking": "a light that blinks",
            "timecode": "timecode",
        }  # fmt: skip
        fields = {"sound": (offset, at), "timecode": ()}
        ways = tuple(Way(by, label, partial(self._synchronize, by), fields.get(by, (offset,))) for by, label in labels.items())
        files = self._there("rig_timed.png")
        if self._is_new(TIMED, RIG):
            return Step("time", title, DONE, f"{TIMED}: how sure each clock is", ways, self._clocks(), files)
        older = self._older(TIMED, RIG)
        said = older or "needed where cameras were started one by one"
        return Step("time", title, TODO if older else OPTIONAL, said, ways, files=files)

    def _synchronize(self, by: str, values: Values) -> list[list[str]]:
        at = ["--at", *_three(values["at"], "where the clap was")] if values.get("at") else []
        force = self._anew(TIMED, "rig_timed.json", "rig_timed.png")
        chosen = [] if by == "motion" else ["--by", by]
        offset = _unless(values, "max_offset", "2") if "max_offset" in values else []
        return [["synchronize", "--rig", RIG, *chosen, *at, *offset, "-o", TIMED, *force]]

    def _clocks(self) -> tuple[str, ...]:
        try:
            metrics = json.loads((self.folder / "rig_timed.json").read_text())["metrics"]
        except (OSError, ValueError, KeyError, TypeError):
            return ()
        found = []
        for name in (key.split(".")[1] for key in metrics if key.endswith(".offset_ms")):
            of = {key: metrics[f"time.{name}.{key}"] for key in ("offset_ms", "offset_sigma_ms", "correlation", "runner_up")}
            doubt = "; another offset fits nearly as well" if of["runner_up"] > 0.8 else ""
            said = f"{of['offset_ms']:+.2f} ± {of['offset_sigma_ms']:.2f} ms, correlation {of['correlation']:.2f}"
            found.append(f"{name}: {said}{doubt}")
        return tuple(found)

    def _world(self) -> Step:
        title, here = "World", self._contents
        if not self._has(RIG):
            return Step("world", title, WAITING, f"needs a rig: {RIG}")
        before = TIMED if self._is_new(TIMED, RIG) else RIG
        ways = []
        if here.board_images:
            images = Field("images", "images of the board on the floor, in", options=tuple(here.board_images),
                           value=_only(tuple(here.board_images)))  # fmt: skip
            ways.append(Way("board", "a board that lies on the floor", lambda v: self._world_board(before, v),
                            (images, *_board_fields(), _lengths_field("board"))))  # fmt: skip
        if here.control_points:
            points = Field("points", "points of known place", options=here.control_points, value=_only(here.control_points))
            ways.append(Way("points", "points of known place", lambda v: self._world_points(before, v),
                            (points, _lengths_field("points"))))  # fmt: skip
        places = self.known_places()
        links = {} if places is None else {f"Click on the points of {places} in the images": "/digitizing.html#control"}
        axis = Field("up", "the axis that points up", options=_AXES)
        ways.append(Way("up", "an axis of the rig's world is up", lambda v: self._world_of(before, [f"--up={v['up']}"]), (axis,)))
        try:
            if self._is_new(WORLD, before):
                said = f"{WORLD}: origin, axes and scale"
                return Step("world", title, DONE, said, tuple(ways), self._centers(WORLD), links=links)
            up = up_of_cameras(load_rig(self.folder / before))
        except TrackerError as error:
            damaged = self._is_new(WORLD, before)  # which can be made again from a rig that is not
            return Step("world", title, TODO if damaged else WAITING, str(error), tuple(ways))
        stands = up is not None and bool(up @ UP > 0.5)
        said = "z is up for the cameras; needed where origin and axes matter" if stands else "z is not up for the cameras"
        more = "; found are images of a board in world/CAMERA.png, and points in a CSV file: camera,point,x,y,z,u,v, or"
        older = self._older(WORLD, before)
        said = older or f"{said}{more} point,x,y,z to be clicked on"
        state = OPTIONAL if stands and not older else TODO
        return Step("world", title, state, said, tuple(ways), self._centers(before), links=links)

    def _world_board(self, before: str, values: Values) -> list[list[str]]:
        images = self._contents.board_images[values["images"]]
        shown = [f"{camera}={path}" for camera, path in images.items()]
        return self._world_of(before, ["--board-images", *shown, *_board(values), *_scale(values)])

    def _world_points(self, before: str, values: Values) -> list[list[str]]:
        return self._world_of(before, ["--points", values["points"], *_scale(values)])

    def _world_of(self, before: str, evidence: list[str]) -> list[list[str]]:
        return [["rig", "world", before, *evidence, "-o", WORLD, *self._anew(WORLD)]]

    def _body(self) -> Step:
        title, rig = "Body", self.current_rig()
        if rig is None:
            return Step("body", title, WAITING, f"needs a rig: {RIG}")
        sets = Field("sets", "image sets to look at", NUMBER, value="20")
        stature = Field("stature", "height, m", NUMBER)
        ways = [
            Way("points", "from points in the videos",
                lambda v: self._body_of(["--from-points", rig, *_unless(v, "sets", "20")]), (sets,)),
            Way("stature", "of a height", lambda v: self._body_of(["--stature", v["stature"]]), (stature,)),
        ]  # fmt: skip
        if self._contents.markers:
            trial = Field("trc", "markers of a static trial", options=self._contents.markers, value=_only(self._contents.markers))
            ways.append(Way("trc", "from markers", lambda v: self._body_of(["--trc", v["trc"], *_axes(v)]), (trial, _up_field())))
        state = DONE if self._has(PERSON) else TODO
        said = PERSON if state == DONE else "lengths of the person, from points, markers or height"
        return Step("body", title, state, said, tuple(ways), self._person())

    def _body_of(self, arguments: list[str]) -> list[list[str]]:
        return [["calibrate", "body", *arguments, "-o", PERSON, *self._anew(PERSON)]]

    def _person(self) -> tuple[str, ...]:
        return (self._first_line(PERSON),) if self._has(PERSON) else ()

    def _first_line(self, name: str) -> str:
        return (self.folder / name).read_text(errors="replace").split("\n", 1)[0].removeprefix("# ")[:200]

    def _start(self) -> Step:
        title, rig = "Start", self.current_rig()
        if rig is None or not self._has(PERSON):
            return Step("start", title, WAITING, f"needs a rig and a body: {RIG}, {PERSON}")
        poses, markers = self._contents.poses, self._contents.markers
        compare = Field("compare", "compare with the images", options=_COMPARED, value=_COMPARED[0])
        ways = [Way("points", "search the person in the images", lambda v: [self._describe(rig, v)], (compare,))]
        if poses:
            pose = Field("pose", "pose", options=poses, value=_only(poses))
            label = "a pose of the first images, set by hand"
            ways.append(Way("pose", label, lambda v: [self._describe(rig, v, v["pose"])], (pose, compare)))
        if markers:
            file = Field("trc", "markers", options=markers, value=_only(markers))
            row = Field("row", "row, from 0", NUMBER, value="0")
            ways.append(Way("trc", "from markers", lambda v: self._posed(rig, v), (file, row, _up_field(), compare)))
        links = {"Set a pose by hand": "/pose.html"}
        state = self._state(RECORDING, rig, PERSON)
        said = f"{RECORDING}: what is tracked, and how it begins" if state == DONE else self._older(RECORDING, rig, PERSON)
        said = said or "points in the images, markers, or a pose that you drag"
        return Step("start", title, state, said, tuple(ways), tuple(f"{p}: {self._first_line(p)}" for p in poses), links=links)

    def _describe(self, rig: str, values: Values, pose: str | None = None) -> list[str]:
        start = [] if pose is None else ["--initial-state", pose]
        force = self._anew(RECORDING, "tracker.yaml")
        contours = ["--modalities", "region"] if values["compare"] == "contours" else []
        return ["new", "recording", "--rig", rig, "--model", PERSON, *start, *contours, "-o", RECORDING, *force]

    def _posed(self, rig: str, values: Values) -> list[list[str]]:
        row = _unless(values, "row", "0")
        pose = ["calibrate", "pose", "--model", PERSON, "--trc", values["trc"], *_axes(values), *row, "-o", START]
        return [[*pose, *self._anew(START)], self._describe(rig, values, START)]

    def _run(self) -> Step:
        title = "Run"
        if not self._has(RECORDING):
            return Step("run", title, WAITING, f"needs {RECORDING}, which the start writes")
        sets = Field("max_sets", "image sets at most (empty: all)", NUMBER, needed=False)
        shrink = Field("shrink", "images smaller by", options=("1", "2", "4"), value="1")
        way = Way("track", "track the videos", lambda v: [self._track(v)], (sets, shrink))
        run = self.current_run()
        state = self._state(f"{run}/run.json", RECORDING)
        plain = f"{run}/" if state == DONE else "tracks all images; may be canceled, and keeps what it has"
        said = self._older(f"{run}/run.json", RECORDING) or plain
        return Step("run", title, state, said, (way,), self._counts())

    def _track(self, values: Values) -> list[str]:
        sets = ["--max-sets", values["max_sets"]] if values["max_sets"] else []
        run = next(name for n in count(1) if not (self.folder / (name := RUN if n == 1 else f"{RUN}_{n}") / "bag").exists())
        return ["track", RECORDING, *sets, *_unless(values, "shrink", "1"), *([] if run == RUN else ["--output", run])]

    def _counts(self) -> tuple[str, ...]:
        try:
            summary = json.loads((self.folder / self.current_run() / "run.json").read_text())
            counts = {str(name): int(n) for name, n in summary["status_counts"].items() if n}
            said = f"{int(summary['image_sets'])} image sets: " + ", ".join(f"{n} {name}" for name, n in counts.items())
            return (said, *map(str, summary.get("errors", ())))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return ()

    def _look(self) -> Step:
        title, run = "Look", self.current_run()
        report = f"{run}/report.html"
        if not self._has(f"{run}/run.json"):
            return Step("look", title, WAITING, "needs a run")
        truth = Field("truth", "compare with", options=("nothing", *self._contents.markers), value="nothing")
        way = Way("evaluate", "report", lambda v: [_evaluate(run, v)], (truth,))
        state = self._state(report, f"{run}/run.json")
        said = self._older(report, f"{run}/run.json") or (report if state == DONE else "the report, and the run over its images")
        return Step("look", title, state, said, (way,), (), self._there(report), {"Play it back": "/playback.html"})

    def _there(self, *names: str) -> tuple[str, ...]:
        return tuple(name for name in names if self._has(name))

    def _cameras(self, name: str) -> tuple[str, ...]:
        """A line on every camera of a rig, whose videos are of the size that it is for."""
        found = []
        for camera in load_rig(self.folder / name):
            source = open_camera_source(camera)
            behind = ", with a background" if camera.background else ""
            size = f"{source.native_width}x{source.native_height}, {source.rate_hz:.5g} Hz"
            found.append(f"{camera.name}: {Path(str(camera.source)).name}, {size}, {source.n_images} images{behind}")
        return tuple(found)

    def _unused(self) -> list[str]:
        """Recordings beside those of the rig that none of its cameras has: one that a calibration has left out."""
        used = {Path(str(camera.source)).resolve() for camera in load_rig(self.folder / RIG)}
        folders = self._contents.recordings.values()
        marked = ({name: (self.folder / name).resolve() in used for name in names} for names in folders)
        return [name for folder in marked if any(folder.values()) for name, is_used in folder.items() if not is_used]

    def _centers(self, name: str) -> tuple[str, ...]:
        centers = {camera.name: camera.center for camera in load_rig(self.folder / name)}
        return tuple(f"{name} stands at {' '.join(f'{value:.2f}' for value in center)} m" for name, center in centers.items())


def _only(options: Sequence[str]) -> str:
    return options[0] if len(options) == 1 else ""


def _is_board(name: str) -> bool:
    return any(part.lower().startswith(("board", "calib", "charuco", "chess")) for part in Path(name).parts)


def _board_fields() -> tuple[Field, ...]:
    pattern = Field("pattern", "pattern", options=_BOARDS, value="charuco")
    size = Field("size", "columns x rows (squares of a ChArUco board, inner corners of a chessboard)", TEXT)
    return pattern, size, Field("square", "edge of a square, m", NUMBER)


def _board(values: Values) -> list[str]:
    size = values["size"].replace(" ", "").replace("\N{MULTIPLICATION SIGN}", "x")
    return [f"--{values['pattern']}", size, "--square", values["square"]]


def _lengths_field(evidence: str) -> Field:
    return Field("lengths", "lengths", options=(_OF_RIG, f"those of the {evidence}"), value=_OF_RIG)


def _scale(values: Values) -> list[str]:
    return [] if values["lengths"] == _OF_RIG else ["--scale"]


def _up_field() -> Field:
    return Field("axes", "up is", options=("y", "z"), value="y")


def _axes(values: Values) -> list[str]:
    return ["--z-up"] if values["axes"] == "z" else []


def _pixels(values: Values) -> list[str]:
    pairs = values["pixel_map"].split()
    for pair in pairs:
        if pair.startswith("-") or not all(pair.partition("=")):
            raise TrackerError(f"how videos were resized: expected camera=what, for each camera, got {pair[:100]!r}")
    return ["--pixel-map", *pairs] if pairs else []


def _unless(values: Values, name: str, usual: str) -> list[str]:
    return [] if values[name] == usual else [f"--{name.replace('_', '-')}", values[name]]


def _evaluate(run: str, values: Values) -> list[str]:
    return ["evaluate", run, *([] if values["truth"] == "nothing" else ["--truth", values["truth"]])]


def _three(text: str, what: str) -> list[str]:
    numbers = text.replace(",", " ").split()
    if len(numbers) != 3:
        raise TrackerError(f"{what}: expected three numbers, in meters, got {text!r}")
    return [_number(number, what) for number in numbers]


def _number(text: str, what: str) -> str:
    """Digits without an exponent: a command line takes -1e-3 for an option."""
    try:
        value = float(text)
    except ValueError:
        value = np.inf
    if not abs(value) < 1e9:
        raise TrackerError(f"{what}: expected a number, got {text[:100]!r}")
    return np.format_float_positional(value, trim="-")


def _checked(asked: Field, value: str) -> str:
    """A value that the field allows; text is never an option of a command."""
    value = value.strip()
    if not value and asked.needed:
        none = f"choose one of {', '.join(asked.options)}" if asked.options else "none in this folder"
        raise TrackerError(f"{asked.label}: {none if asked.kind == CHOICE else 'still to be filled in'}")
    if not value:
        return value
    if asked.kind == CHOICE and value not in asked.options:
        raise UnknownNameError(asked.label, value, asked.options)
    if asked.kind == NUMBER:
        return _number(value, asked.label)
    if asked.kind == TEXT and ((value.startswith("-") and asked.name != "at") or len(value) > 500):
        raise FileFormatError("request", asked.name, asked.label, value[:100])
    return value
