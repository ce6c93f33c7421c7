"""The grammar of image sources, in rig files and on the command line; the natural order of files, and which is a camera's.

============================================  ======================================================================
``videos/cam1.mp4``, ``file:videos/cam1.mp4``  video file, folder of images, or pattern of image files
``bag:out/run1/bag``                           the images of this camera in a bag
``bag:out/run1/bag#/left/image_raw``           those of a topic of the bag, raw or compressed
``v4l2:/dev/v4l/by-id/usb-...-index0``         a camera of this computer, by a path that stays the same
``rtsp://``, ``http://``, ``udp://``, ...      a stream of the network
``topic:/left/image_raw``                      what another node publishes; ``.../compressed`` for compressed images
============================================  ======================================================================
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import SourceError, without_password

_VARIABLE = "TRACKER_NODE_SOURCES"
FILE, BAG, DEVICE, STREAM, TOPIC = "file", "bag", "v4l2", "stream", "topic"
STREAM_SCHEMES = ("rtsp", "rtsps", "http", "https", "udp", "tcp", "rtmp", "srt")
_PATTERN = re.compile(r"(?:[^{}]|\{\{|\}\}|\{name\}|\{number(?::\d{1,2}d?)?\})*")
TOPIC_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


def natural(name: str | Path) -> tuple[list[tuple[int, int, str]], str]:
    """Key of an order in which ``cam10`` comes after ``cam9``, numbers before letters, ``IMG_2`` beside ``img_1``."""
    parts = enumerate(re.split(r"([0-9]+)", str(name)))
    # The name itself at last: ``img1`` and ``img01`` are to have an order that the file system does not make
    return [(0, int(part), "") if i % 2 else (1, 0, part.lower()) for i, part in parts if part], str(name)


_NUMBER = re.compile(r"[0-9]{1,18}")


def numbers_in(name: str) -> list[int]:
    """The numbers in a name, such as 1 and 12 of ``cam1_000012``."""
    return list(map(int, _NUMBER.findall(name)))


def last_number(name: str) -> int | None:
    """The last number in a name: the camera's in ``int_cam01_img``, the image's in ``cam1_000012``; None where there is none."""
    return next(reversed(numbers_in(name)), None)


def identifier(name: str) -> str:
    """A name that can be part of a topic: ``0`` becomes ``cam_0``."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    return name if name.isidentifier() else f"cam_{name}"


def files_of_cameras(files: Iterable[str], cameras: Sequence[str]) -> dict[str, str]:
    """Which of some files, or folders, belongs to which camera, by their names.

    The first rule that fits one file alone counts: the camera's name (``cam_01``, ``Cam-01``, ``cam_01_json``); its name as a
    word, or at the end (``trial2_cam01``, ``walk-camA`` for ``A``); its last number (``cam1`` for ``cam_01``). A single file
    belongs to a single camera whatever its name. Numbers do not count where both cameras and files are left over: one of them
    may begin at 0 and the other at 1.

    Parameters
    ----------
    files, cameras : their names.

    Returns
    -------
    Camera -> file; cameras without one are absent. Empty where two have the same.
    """
    files = list(files)
    if len(files) == len(cameras) == 1:
        return {cameras[0]: files[0]}
    found, by_number = {}, set()
    for camera in cameras:
        rules = _rules(files, camera)
        rule = next((i for i, fitting in enumerate(rules) if len(fitting) == 1), None)
        if rule is not None:
            found[camera] = rules[rule][0]
        if rule == len(rules) - 1:
            by_number.add(camera)
    if len(found) < min(len(cameras), len(files)):
        found = {camera: file for camera, file in found.items() if camera not in by_number}
    return found if len(set(found.values())) == len(found) else {}


def _rules(files: Sequence[str], camera: str) -> tuple[list[str], ...]:
    """The files that each rule of `files_of_cameras` fits; that of the number is the last."""
    own, number = identifier(camera).lower(), last_number(camera)
    word = re.compile(rf"(?<![^\W_]){re.escape(camera)}(?![^\W_])", re.IGNORECASE)
    end = re.compile(rf"{'(?<![0-9])' if camera[:1].isdigit() else ''}{re.escape(camera)}$")  # cam12 does not end in 2
    return (
        [file for file in files if identifier(file).lower() in (own, f"{own}_json")],
        [file for file in files if word.search(file)],
        [file for file in files if end.search(file)],
        [file for file in files if number is not None and last_number(file) == number],
    )


def rivals(files: Iterable[str], camera: str) -> list[str]:
    """The files of which none is the camera's because several fit it by the same rule.

    Parameters
    ----------
    files, camera : their names.

    Returns
    -------
    Two or more, or none.
    """
    return next((fitting for fitting in _rules(list(files), camera) if len(fitting) > 1), [])


@dataclass(frozen=True)
class SourceAddress:
    """Where images come from.

    Parameters
    ----------
    kind : `FILE`, `BAG`, `DEVICE`, `STREAM` or `TOPIC`.
    target : path, URL or topic.
    topic : topic within a bag, or none.
    """

    kind: str
    target: str
    topic: str = ""

    @property
    def is_live(self) -> bool:
        """Whether its images come when they come, and not again."""
        return self.kind in (DEVICE, STREAM, TOPIC)

    @property
    def shown(self) -> str:
        """Address for messages: without the user and the password of a stream."""
        return without_password(str(self))

    def __str__(self) -> str:
        if self.kind in (FILE, STREAM):
            return self.target
        return f"{self.kind}:{self.target}" + (f"#{self.topic}" if self.topic else "")


def sources_for_child(sources: Mapping[str, str]) -> dict[str, str]:
    """Variables of the environment that give sources to a child: what stands on its command line, everybody can read."""
    return {_VARIABLE: json.dumps(dict(sources))} if sources else {}


def sources_from_parent() -> list[tuple[str, str]]:
    """(camera, source) of `sources_for_child`."""
    return list(json.loads(os.environ.get(_VARIABLE, "{}")).items())


def parse_source(text: str) -> SourceAddress:
    """The address that ``text`` names; see the module.

    Raises
    ------
    SourceError : a scheme that is not known, or nothing behind it.
    """
    stream = re.match(r"([A-Za-z][A-Za-z0-9+.-]*)://", text)
    if stream and stream[1].lower() in STREAM_SCHEMES:
        return SourceAddress(STREAM, text)
    scheme = re.match(r"([A-Za-z][A-Za-z0-9+.-]+):", text)
    if scheme is None or os.path.exists(text):
        return SourceAddress(FILE, text)
    kind, rest = scheme[1].lower(), text[scheme.end() :]
    if kind not in (FILE, BAG, DEVICE, TOPIC):
        known = ", ".join([*(f"{name}:" for name in (FILE, BAG, DEVICE, TOPIC)), *(f"{name}://" for name in STREAM_SCHEMES)])
        raise SourceError(without_password(text), f"unknown kind of source '{scheme[1]}:'; known are paths of files and {known}")
    rest = rest.removeprefix("//") if kind != TOPIC else rest
    target, _, topic = rest.partition("#") if kind == BAG else (rest, "", "")
    if not target or (kind == TOPIC and not TOPIC_NAME.fullmatch(target)):
        raise SourceError(without_password(text), f"expected a {'topic' if kind == TOPIC else 'path'} behind '{kind}:'")
    return SourceAddress(kind, target, topic)


def relocated(text: str, old_dir: str | Path, new_dir: str | Path | None = None) -> str:
    """A source with its path taken from another folder.

    Parameters
    ----------
    text, old_dir : source; folder that its path is relative to.
    new_dir : folder that the path becomes relative to; None for an absolute path.

    Returns
    -------
    Source; one without a path as it is.
    """
    address = parse_source(text)
    if address.kind not in (FILE, BAG) or os.path.isabs(address.target):
        return text
    path = os.path.normpath(os.path.join(old_dir, address.target))
    return str(replace(address, target=path if new_dir is None else os.path.relpath(path, new_dir)))


def filled(pattern: str, name: str, number: int) -> str:
    """A pattern of sources, such as ``videos/{name}.mp4`` or ``cam{number:02}``, for one camera.

    Parameters
    ----------
    pattern, name, number : pattern; name of the camera, and its number.

    Returns
    -------
    Source.

    Raises
    ------
    SourceError : other fields; ``str.format`` would let a file ask for gigabytes of blanks, or for attributes.
    """
    if not _PATTERN.fullmatch(pattern):
        raise SourceError(pattern, "expected a pattern with {name} or {number}, e.g. 'videos/cam{number:02}.mp4'")
    return pattern.format(name=name, number=number)


def sources_by_name(
    pattern: str | None, names: Iterable[str], numbers: Mapping[str, int] | None = None
) -> dict[str, str | None]:
    """The source of each camera by a pattern, numbered from 1; None for all without a pattern.

    Parameters
    ----------
    pattern : such as ``videos/{name}.mp4`` or ``cam{number:02}``.
    names : of the cameras, in the order of the rig.
    numbers : of the cameras, where another order counts.

    Returns
    -------
    Camera name -> source.

    Raises
    ------
    SourceError : a pattern with other fields than {name} and {number}, or of a kind of source that is not known.
    """
    sources: dict[str, str | None] = dict.fromkeys(names)
    if pattern is None:
        return sources
    for place, name in enumerate(sources, start=1):
        source = filled(pattern, name, place if numbers is None else numbers[name])
        parse_source(source)
        sources[name] = source
    return sources
