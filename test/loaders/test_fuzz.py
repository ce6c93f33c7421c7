"""Files gone wrong at one place: they load, or end in an error that names file and field; nothing else comes out."""

import copy
import random

import numpy as np
import pytest
import yaml

from helpers.bodies.bodies import crane
from tracker_node.errors import CalibrationError, FileFormatError
from tracker_node.loaders.model.mesh_file import write_texture
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.model.state_yaml import dump_state, load_state
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import State
from tracker_node.runs.config_file import dump_config, load_config
from tracker_node.tracking.config import TrackerConfig

JUNK = [
    None, "", "text", "1e400", True, False, 0, -1, 7, 10**30, -0.5, 1e308, float("nan"), float("inf"), [], [[]], [None], {},
    {"a": 1}, [1, 2], [1, 2, 3], ["x", "y", "z"], [[1, 0, 0], [0, 1, 0], [0, 0, 0]], {1: 2}, "base", "arm", "none", "équi",
]  # fmt: skip
RIG = """
cameras:
  left:
    {image_size: [64, 48], K: [[60, 0, 32], [0, 60, 24], [0, 0, 1]], distortion_model: plumb_bob, distortion: [0, 0, 0, 0],
    T_world_cam: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], source: a.mp4, background: b.png, time_offset_s: 0.1,
    pixel_map: [[1, 0, 0], [0, 1, 0]], file_image_size: [64, 48], gain: 1.5, gamma: 2.2, interlaced: top_first}
lights: [{kind: spot, position: [0, 0, 3], direction: [0, 0, -1], cone_deg: 30, intensity: 1}]
"""


PART = """
name: part
links: [base]
shapes:
  sleeve: {link: base, type: lofted, sections: [{z: 0, half_x: 0.1, half_y: 0.2}, {z: 0.3, half_x: 0.2, half_y: 0.1, x: 0.01}],
    domes: [0.05, 0.1], vertices_around: 12, ring_spacing: 0.05}
  box: {link: base, type: box, size: [1, 2, 3], face_colors_rgb: {"+x": [1, 2, 3], "-z": [4, 5, 6]}, textures: {"+y": a.png}}
"""


def places(values, path=()):
    """Paths of every node below the top."""
    items = values.items() if isinstance(values, dict) else enumerate(values) if isinstance(values, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


def damage(values, rng: random.Random):
    """A copy with one node replaced, taken out, renamed or doubled."""
    result = copy.deepcopy(values)
    path = rng.choice(list(places(result)))
    parent = result
    for key in path[:-1]:
        parent = parent[key]
    key, action = path[-1], rng.choice(("replace", "replace", "replace", "remove", "rename", "repeat"))
    if action == "remove":
        del parent[key]
    elif action == "rename" and isinstance(parent, dict):
        parent[rng.choice(["x", 3, "Name", ""])] = parent.pop(key)
    elif action == "repeat" and isinstance(parent, list):
        parent.append(copy.deepcopy(parent[key]))
    else:
        parent[key] = rng.choice(JUNK)
    return result


@pytest.fixture(scope="module")
def valid(tmp_path_factory):
    """Kind -> (loader of a path, content of a valid file, folder that it must lie in)."""
    folder, model = tmp_path_factory.mktemp("valid"), crane()
    dump_model(model, folder / "model.yaml")
    dump_state(State.neutral(model), model, folder / "state.yaml")
    dump_config(TrackerConfig(), folder / "config.yaml")
    (folder / "rig.yaml").write_text(RIG)
    (folder / "part.yaml").write_text(PART)
    write_texture(np.zeros((2, 3, 3), np.uint8), folder / "a.png")
    loaders = {"model": load_model, "state": lambda path: load_state(path, model), "config": load_config, "rig": load_rig}
    loaders["part"] = load_model
    return {kind: (load, yaml.safe_load((folder / f"{kind}.yaml").read_text()), folder) for kind, load in loaders.items()}


@pytest.mark.parametrize("kind", ["model", "part", "state", "config", "rig"])
def test_damaged_yaml(valid, kind):
    load, content, folder = valid[kind]
    rng, refused, path = random.Random(kind), 0, folder / f"damaged_{kind}.yaml"
    for _ in range(100):
        damaged = damage(content, rng)
        path.write_text(yaml.safe_dump(damaged, sort_keys=False, allow_unicode=True))
        try:
            load(path)
        except FileFormatError as error:
            refused += 1
            assert str(path) in str(error)
            assert error.field or error.got == ""  # a field without a name is named by being empty
        except CalibrationError as error:
            refused += 1
            assert error.camera == "left"
    assert refused > 0.5 * 100


def test_truncated_and_garbled_text(valid, tmp_path):
    rng = random.Random(1)
    for kind, (load, content, folder) in valid.items():
        text = yaml.safe_dump(content, sort_keys=False)
        path = folder / f"garbled_{kind}.yaml"
        for _ in range(40):
            at = rng.randrange(len(text))
            path.write_text(
                text[:at] if rng.random() < 0.5 else text[:at] + rng.choice("{}[]:,&*!|>'\"%@`\t-#\x07é") + text[at + 1 :]
            )
            try:
                load(path)
            except FileFormatError as error:
                assert str(path) in str(error)
            except CalibrationError:
                pass


def test_damaged_trc(tmp_path):
    header = "PathFileType\t4\t(X/Y/Z)\tt.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n60\t60\t2\t2\tmm\n"
    text = (
        header
        + "Frame#\tTime\tHip\t\t\tKnee\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.1\t1\t2\t3\t4\t5\t6\n"
    )
    rng, path, refused = random.Random(2), tmp_path / "t.trc", 0
    for _ in range(400):
        at = rng.randrange(len(text))
        path.write_text(
            rng.choice((text[:at], text[:at] + rng.choice("\t\n x-.eN") + text[at + 1 :], text[:at] + text[at + 3 :]))
        )
        try:
            markers = load_trc(path)
            assert len(markers) >= 1
        except FileFormatError as error:
            refused += 1
            assert str(path) in str(error)
    assert refused > 100
