"""Cameras on the command line: their image topics as rules of remapping, their sources, and sizes of images and boards."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...camera.rig import CameraRig


def add_topics_argument(parser: argparse.ArgumentParser) -> None:
    """``--topics``; shared by the nodes of a rig."""
    parser.add_argument(
        "--topics",
        nargs="+",
        default=[],
        type=camera_topic,
        metavar="CAMERA=TOPIC",
        help="topic of a camera's images, with camera_info beside it (default: what the rig says, else CAMERA/image_raw)",
    )


def camera_topic(text: str) -> tuple[str, str]:
    """``left=/front/image_raw`` -> (``left``, ``/front/image_raw``)."""
    from ...loaders.source_address import TOPIC_NAME

    name, _, topic = text.partition("=")
    if not name.isidentifier() or not TOPIC_NAME.fullmatch(topic):
        raise argparse.ArgumentTypeError(f"expected CAMERA=TOPIC, as in cam01=/front/image_raw, got '{text}'")
    return name, topic


def with_topics(ros_args: list[str], rig: CameraRig | None, given: Mapping[str, str]) -> list[str]:
    """ROS arguments with the rules of remapping for all cameras; rules that are in them already go first.

    Parameters
    ----------
    ros_args : as given.
    rig : with topics of its cameras; None: there is none.
    given : camera -> topic, in place of the rig's.

    Returns
    -------
    ros_args : longer where a camera has a topic of its own.

    Raises
    ------
    UnknownNameError : a topic is given for a camera that there is not.
    """
    from ...errors import UnknownNameError

    topics = {} if rig is None else {camera.name: camera.topic for camera in rig if camera.topic}
    known = list(given) if rig is None else list(rig.names)
    for name in given:
        if name not in known:
            raise UnknownNameError("camera", name, known)
    rules = []
    for name, topic in {**topics, **given}.items():
        info = "/".join([*topic.split("/")[:-1], "camera_info"])
        rules += [f"{name}/image_raw:={topic}", f"{name}/image_raw/compressed:={topic}/compressed", f"{name}/camera_info:={info}"]
    return [*ros_args, "--ros-args", *(part for rule in rules for part in ("-r", rule)), "--"] if rules else ros_args


def tracker_name(ros_args: Sequence[str], renamed: bool = True) -> str:
    """Of a tracker, with its namespace, as rules of remapping give it: ``-r __node:=anna -r __ns:=/lab`` -> "/lab/anna".

    Parameters
    ----------
    ros_args : as given.
    renamed : they are the tracker's own; False: those of another node beside it.

    Returns
    -------
    name : beginning with a slash.
    """
    given = [re.fullmatch(r"(?:tracker:)?__(node|name|ns):=(\S+)", text) for text in reversed(ros_args)]  # the first rule counts
    names = {"ns" if rule[1] == "ns" else "node": rule[2] for rule in given if rule}
    return f"{names.get('ns', '').rstrip('/')}/{names.get('node', 'tracker') if renamed else 'tracker'}"


def add_sources_argument(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--sources",
        metavar="PATTERN",
        help="video or image folder of each camera; {name} is its name, {number} counts from 1, as in 'videos/{name}.mp4'; or the"
        " folder of them all, which belong to the cameras of their names, their numbers, or in their order",
    )


UNITS = ("m", "cm", "mm")  # of `calibration.imported`


def sources_of_cameras(
    pattern: str | None, names: Sequence[str], tell: Callable[[str], None], numbers: Mapping[str, int] | None = None
) -> dict[str, str | None]:
    """What ``--sources`` says of each camera.

    Parameters
    ----------
    pattern : with {name} or {number}, or a folder of recordings; None: nothing.
    names : of the cameras.
    tell : called with the recordings of a folder by camera, and a sentence where their names do not settle it.
    numbers : of the cameras, where {number} is not their place in ``names``.

    Returns
    -------
    Camera -> source; of a folder only those that have one.

    Raises
    ------
    TrackerError : no such pattern, or recordings that are not those of the cameras.
    """
    from ...loaders.projects import has_images, recordings_by_camera, recordings_in
    from ...loaders.source_address import sources_by_name

    folder = None if pattern is None or "{" in pattern else Path(pattern)
    if folder is None or has_images(folder) or not recordings_in(folder):
        return sources_by_name(pattern, names, numbers)
    found = recordings_by_camera(folder, names, tell)
    tell(", ".join(f"{name} ({path.name})" for name, path in found.items()))
    return {name: str(path) for name, path in found.items()}


def add_pixel_map_argument(parser: argparse.ArgumentParser) -> None:
    """``--pixel-map``, see `calibration.video_pixels`."""
    parser.add_argument(
        "--pixel-map", nargs="+", metavar="CAMERA=KIND",
        help="how images of another size than the calibration's were made of it, where sizes, rotation and black bars do not"
        " tell: resampled, clockwise, counterclockwise, bars, cut or stretched",
    )  # fmt: skip


_PAIR = re.compile(r"([0-9]{1,6})x([0-9]{1,6})", re.IGNORECASE)
_IMAGE = "WIDTHxHEIGHT in pixels, such as 640x480"


def image_size(text: str) -> tuple[int, int]:
    """``640x480`` -> (640, 480), for argparse."""
    size = _pair(text)
    if size is None or min(size) < 1:
        raise argparse.ArgumentTypeError(f"expected {_IMAGE}, got '{text}'")
    return size


def size_option(option: str, text: str, expected: str = _IMAGE, least: int = 1, most: int = 10**6) -> tuple[int, int]:
    """The two numbers of an option, each from ``least`` to ``most``.

    Parameters
    ----------
    option : for messages.
    text : such as ``640x480``.
    expected : in words, for messages.
    least, most : of each number.

    Returns
    -------
    first, second : the numbers.

    Raises
    ------
    FileFormatError : naming the option and what is ``expected`` of it.
    """
    from ...errors import FileFormatError

    size = _pair(text)
    if size is None or not all(least <= number <= most for number in size):
        raise FileFormatError("command line", option, expected, text)
    return size


def _pair(text: str) -> tuple[int, int] | None:
    found = _PAIR.fullmatch(text)
    return (int(found[1]), int(found[2])) if found else None
