"""XML of a robot description, read so that every error names the file and the place in it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ...errors import FileFormatError
from ...geometry import se3, so3
from ..file_model import LARGEST
from ..json_values import parse_xml
from ..whole_file import read_bytes

_XACRO = "a plain URDF (make one with `xacro FILE > robot.urdf`)"


class Node:
    """An XML element with its file and the path to it, ``joint[elbow].origin``."""

    def __init__(self, element: ElementTree.Element, path: Path, field: str):
        self.element, self.path, self.field = element, path, field

    @property
    def tag(self) -> str:
        return self.element.tag

    def error(self, expected: str, got: object, attribute: str = "") -> FileFormatError:
        """Error at this element.

        Parameters
        ----------
        expected, got : what the message says.
        attribute : where it is, if not the element itself.

        Returns
        -------
        Error to raise.
        """
        return FileFormatError(self.path, f"{self.field}.{attribute}" if attribute else self.field, expected, got)

    def all(self, tag: str) -> list[Node]:
        """Children of a kind; those that have a name are called by it."""
        result = []
        for child in self.element.findall(tag):
            name = child.get("name")
            label = tag if name is None else f"{tag}[{name}]"
            result.append(Node(child, self.path, label if self.field == "robot" else f"{self.field}.{label}"))
        return result

    def one(self, tag: str) -> Node | None:
        """The only child of a kind, or None."""
        found = self.all(tag)
        if len(found) > 1:
            raise self.error(f"one <{tag}>", f"{len(found)} of them")
        return found[0] if found else None

    def needed(self, tag: str) -> Node:
        """The only child of a kind, which must be there."""
        found = self.one(tag)
        if found is None:
            raise self.error(f"a <{tag}>", "none")
        return found

    def text(self, attribute: str) -> str:
        """An attribute that must be there and not be empty."""
        value = self.element.get(attribute)
        if not value:
            raise self.error("text", "nothing" if value is None else value, attribute)
        return value

    def number(self, attribute: str, default: float | None = None) -> float:
        """A finite number of an attribute.

        Parameters
        ----------
        attribute, default : name; value where it is missing, None where it must be there.

        Returns
        -------
        The number.
        """
        value = self.element.get(attribute)
        if value is None and default is not None:
            return default
        return self._numbers(value, attribute, 1, "a finite number")[0]

    def positive(self, attribute: str) -> float:
        value = self.number(attribute)
        if not value > 0.0:
            raise self.error("a positive number (meters)", value, attribute)
        return value

    def numbers(self, attribute: str, n: int, default: Sequence[float] | None = None) -> tuple[float, ...]:
        """Finite numbers of an attribute.

        Parameters
        ----------
        attribute, n : name; how many.
        default : values where it is missing, None where it must be there.

        Returns
        -------
        (n,) numbers.
        """
        value = self.element.get(attribute)
        if value is None and default is not None:
            return tuple(default)
        return self._numbers(value, attribute, n, f"{n} finite numbers")

    def _numbers(self, value: str | None, attribute: str, n: int, expected: str) -> tuple[float, ...]:
        words = (value or "").split()
        try:
            numbers = tuple(float(word) for word in words if "_" not in word)
        except ValueError:
            numbers = ()
        if len(numbers) != n or len(words) != n or not all(abs(number) <= LARGEST for number in numbers):
            raise self.error(expected, "nothing" if value is None else value, attribute)
        return numbers

    def origin(self) -> np.ndarray:
        """T (4, 4) of the <origin>: xyz in meters; rpy in radians about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll)."""
        origin = self.one("origin")
        if origin is None:
            return np.eye(4)
        angles = origin.numbers("rpy", 3, (0.0, 0.0, 0.0))
        return se3.from_rotation_translation(so3.from_roll_pitch_yaw(angles), np.array(origin.numbers("xyz", 3, (0.0, 0.0, 0.0))))


def read_robot(path: str | Path) -> Node:
    """The <robot> of a URDF file.

    Raises
    ------
    FileFormatError : no such file, no XML (with line and column), no <robot>, or a xacro file.
    """
    path = Path(path)
    if path.suffix.lower() == ".xacro":
        raise FileFormatError(path, "(file)", _XACRO, "a xacro file")
    content = read_bytes(path)
    if not content.startswith((b"\xff\xfe", b"\xfe\xff")):  # UTF-16
        content = content.rstrip(b"\0")  # some programs end their files like C text
    root = parse_xml(content, path)
    if root.tag != "robot":
        raise FileFormatError(path, "(top level)", "<robot>", f"<{root.tag}>")
    for element in root.iter():
        values = [element.tag, *element.attrib.values()] if isinstance(element.tag, str) else []
        for value in values:
            if "www.ros.org/wiki/xacro" in value or "ros.org/xacro" in value or "${" in value or "$(" in value:
                raise FileFormatError(path, "(file)", _XACRO, value)
    return Node(root, path, "robot")
