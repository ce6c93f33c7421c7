"""Robot descriptions gone wrong at one place: they load, or end in an error that names file and field; nothing else comes out."""

import copy
import random
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np

from helpers.bodies.robot_text import ROBOT
from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State

JUNK = [
    "",
    " ",
    "nan",
    "inf",
    "-1e999",
    "1e13",
    "x",
    "0",
    "-1",
    "1 2",
    "1 2 3 4",
    "1_0 0 0",
    "0x1 0 0",
    "٣ 0 0",
    "base",
    "équi",
    "${a}",
    "\u00a0",
]
CHARACTERS = "<>&\"'/=\x07\x00é "


def damage(robot: ElementTree.Element, rng: random.Random) -> ElementTree.Element:
    """A copy with one element or attribute replaced, taken out, renamed or doubled."""
    result = copy.deepcopy(robot)
    parents = [element for element in result.iter() if len(element)]
    parent = rng.choice(parents)
    child = rng.choice(list(parent))
    action = rng.choice(("remove", "rename", "repeat", "move", "value", "value", "value", "drop", "swap"))
    holders = [element for element in result.iter() if element.attrib]
    holder = rng.choice(holders)
    key = rng.choice(list(holder.attrib))
    if action == "remove":
        parent.remove(child)
    elif action == "rename":
        child.tag = rng.choice(["x", "link", "joint", "box", "origin", "Visual", "limit"])
    elif action == "repeat":
        parent.append(copy.deepcopy(child))
    elif action == "move":
        parent.remove(child)
        result.append(child)
    elif action == "value":
        holder.set(key, rng.choice(JUNK))
    elif action == "drop":
        del holder.attrib[key]
    else:
        holder.set(key, rng.choice([v for element in holders for v in element.attrib.values()]))
    return result


def check(path) -> bool:
    """True if the file is refused."""
    try:
        model = load_model(path)
    except FileFormatError as error:
        assert str(path) in str(error)
        assert error.field
        return True
    assert len(model.shapes) > 0
    assert np.isfinite(Configuration(model, State.neutral(model)).Ts_world_shape).all()
    return False


def test_damaged_elements(tmp_path):
    rng, robot, path = random.Random(0), ElementTree.fromstring(ROBOT), tmp_path / "damaged.urdf"
    refused = 0
    for _ in range(400):
        ElementTree.ElementTree(damage(robot, rng)).write(path, encoding="utf-8")
        refused += check(path)
    assert refused > 0.6 * 400


def test_garbled_text(tmp_path):
    rng, path, refused = random.Random(1), tmp_path / "garbled.urdf", 0
    for _ in range(200):
        at = rng.randrange(len(ROBOT))
        path.write_text(ROBOT[:at] if rng.random() < 0.3 else ROBOT[:at] + rng.choice(CHARACTERS) + ROBOT[at + 1 :])
        refused += check(path)
    assert refused > 0.6 * 200


def test_any_bytes(tmp_path):
    rng, path = np.random.default_rng(0), tmp_path / "bytes.urdf"
    for start in (b"", b"\xff\xfe", b'<?xml version="1.0" encoding="utf-7"?>', b'<?xml version="1.0" encoding="x-none"?>'):
        for n in (0, 1, 50, 3000):
            path.write_bytes(start + rng.bytes(n))
            assert check(path)
    laughs = [f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in pairwise("abcdefghi")]
    path.write_text('<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">' + "".join(laughs) + "]><robot name='&i;'/>")
    assert check(path)
