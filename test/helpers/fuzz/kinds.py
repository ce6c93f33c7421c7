"""Kinds of files that are fuzzed: valid examples, their readers, and what must hold of whatever is read."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from helpers.bodies.bodies import crane, gantry, tetrahedron
from helpers.bodies.robot_text import ROBOT
from helpers.cameras.camera_rigs import circle_rig
from helpers.fuzz.mutations import NEUTRAL_YAML, damage_bytes, damage_content, damage_numbers, damage_yaml, yaml_text
from helpers.sources import point_files
from tracker_node.camera.rig import CameraRig
from tracker_node.loaders.images.stamps import load_stamp_file
from tracker_node.loaders.keypoints.camera_people import PointsByCamera
from tracker_node.loaders.keypoints.formats import load_points
from tracker_node.loaders.keypoints.table import dump_keypoint_table, load_keypoint_table
from tracker_node.loaders.model.mesh_file import read_mesh, write_mesh, write_texture
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.model.state_yaml import dump_state, load_state
from tracker_node.loaders.motion.trc import dump_table, load_table, load_trc
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.loaders.rig.control_points import load_clicks, load_control_points, load_places
from tracker_node.loaders.rig.opencv_storage import dump_opencv, load_opencv
from tracker_node.loaders.rig.rig_yaml import load_rig, read_rig_file, rig_file_of, write_rig_file
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import COCO_17
from tracker_node.runs.config_file import dump_config, load_config
from tracker_node.tracking.config import TrackerConfig

RIG = """
world_frame: map
cameras:
  left:
    {image_size: [64, 48], K: [[60, 0, 32], [0, 60, 24], [0, 0, 1]], distortion_model: plumb_bob, distortion: [0.1, 0, 0, 0],
    T_world_cam: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], source: a.mp4, background: b.png, time_offset_s: 0.1,
    pixel_map: [[1, 0, 0], [0, 1, 0]], file_image_size: [64, 48], gain: 1.5, gamma: 2.2, interlaced: top_first}
  right:
    {image_size: [640, 480], K: [[600, 0, 320], [0, 600, 240], [0, 0, 1]], distortion_model: equidistant,
    distortion: [0.01, 0, 0, 0], T_world_cam: [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], stamp_file: t.csv,
    source: "v4l2:/dev/video0", time_drift_ppm: 20, capture: {pixel_format: MJPG, rate_hz: 30, exposure_us: 500, gain: 2,
    controls: {focus_absolute: 30}, bayer: rggb, publish: native, camera_info_url: "file:///tmp/a.yaml"}}
lights: [{kind: spot, position: [0, 0, 3], direction: [0, 0, -1], cone_deg: 30, intensity: 1}, {kind: ambient}]
"""
PART = """
name: part
links: [base, lid]
joints: {hinge: {parent: base, child: lid, xyz: [0, 0, 0.3], axes: [{name: open, direction: [1, 0, 0], limits_deg: [0, 90]}]}}
shapes:
  sleeve: {link: base, type: lofted, sections: [{z: 0, half_x: 0.1, half_y: 0.2}, {z: 0.3, half_x: 0.2, half_y: 0.1, x: 0.01}],
    domes: [0.05, 0.1], vertices_around: 12, ring_spacing: 0.05}
  box: {link: lid, type: box, size: [1, 2, 3], face_colors_rgb: {"+x": [1, 2, 3], "-z": [4, 5, 6]}, textures: {"+y": a.png}}
"""
CLICKS = "camera,point,u,v\nleft,nose,10.5,20.25\nleft,chin,11,30\nright,nose,300,200.125\n"
CONTROL = "camera,point,x,y,z,u,v\nleft,a,0,0,1.5,10,20\nleft,b,1,0,0,30,40\nright,a,0,0,1.5,50,60.5\n"
PLACES = "point,x,y,z\na,0,0,1.5\nb,1,0,0\n"
TABLE = "Coordinates\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\nendheader\ntime\tknee\thip\n0.0\t10\t20\n0.5\t30\tnan\n"
RECORDING = """
{rig: a.png, model: a.png, initial_state: a.png, config: a.png, output: run, cameras: [left, right],
sources: "v/{name}{number:02}.mp4",
images: {start: 3, end: 9, rate_hz: 30, shrink: 2}, record: {masks: true, overlays: false, markers: true},
evaluate: {truth: [a.png], masks: a.png, name: run, image_sets: 100, targets: [lost_sets<=0]}}
"""
STAMPS = "camera,image,time_s\nleft,0,0.0\nleft,1,0.0333\nleft,2,0.0667\nright,0,0.01\nright,1,0.043\n"
TRC = (
    "PathFileType\t4\t(X/Y/Z)\tt.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n60\t60\t2\t2\tmm\n"
    "Frame#\tTime\tHip\t\t\tKnee\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.1\t1\t2\t3\t4\t5\t6\n"
)
_BINARY = (".h5", ".zip")


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Parameters
    ----------
    content : a valid file; ``values`` the same as a mapping, for YAML.
    load : path -> object; raises a TrackerError.
    check : raises AssertionError unless an object can be used.
    dump : object, path -> None, where the object can be written; loading it again must give the same.
    """

    name: str
    suffix: str
    content: bytes
    load: Callable[[Path], Any]
    check: Callable[[Any], None]
    dump: Callable[[Any, Path], Any] | None = None
    values: dict | None = None

    def case(self, rng: random.Random) -> tuple[bytes, bool]:
        """A file, and whether it says the same as the valid one."""
        if self.values is None:
            numbers = rng.random() < 0.5 and self.suffix not in _BINARY
            return (damage_numbers if numbers else damage_bytes)(self.content, rng), False
        way = rng.random()
        if way < 0.03:
            return rng.choice(NEUTRAL_YAML)(self.values), True
        if way < 0.70:
            return yaml_text(damage_content(self.values, rng)).encode(errors="surrogatepass"), False
        if way < 0.80:
            return damage_yaml(self.values, rng), False
        return damage_bytes(self.content, rng), False


def finite(value: Any) -> bool:
    """True when every float below an object is finite; joints may be without limits."""
    return all(np.all(np.isfinite(array)) for array in _arrays(value))


def _arrays(value: Any):
    if isinstance(value, (float, np.floating)) or (isinstance(value, np.ndarray) and value.dtype.kind == "f"):
        yield value
    elif is_dataclass(value):
        for field in fields(value):
            yield from _arrays(getattr(value, field.name))
    elif isinstance(value, dict):
        for item in value.values():
            yield from _arrays(item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _arrays(item)


def same(a: Any, b: Any) -> bool:
    """Equal in all they hold, numbers to twelve digits (degrees are written, radians kept)."""
    if isinstance(a, (float, np.ndarray, np.floating)) or isinstance(b, (float, np.ndarray, np.floating)):
        return np.shape(a) == np.shape(b) and np.allclose(a, b, rtol=1e-9, atol=1e-11, equal_nan=True)
    if type(a) is not type(b):
        return False
    if is_dataclass(a):
        return all(same(getattr(a, field.name), getattr(b, field.name)) for field in fields(a))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    if hasattr(a, "__dict__"):
        return same(vars(a), vars(b))
    return a == b


def _check_rig(rig: CameraRig) -> None:
    for camera in rig:
        K, T = camera.model.K, camera.T_world_cam
        assert np.isfinite(K).all() and K[0, 0] > 0.0 and K[1, 1] > 0.0
        assert np.isfinite(T).all() and np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-6)
        pixels, _ = camera.model.project(np.array([[0.0, 0.0, 2.0], [0.01, 0.02, 2.0]]))
        assert np.isfinite(pixels).all(), pixels


def _check_model(model: ArticulatedModel) -> None:
    assert np.isfinite(Configuration(model, State.neutral(model)).Ts_world_shape).all()


def _check_config(config: TrackerConfig) -> None:
    assert finite(config)


def _check_state(model: ArticulatedModel) -> Callable[[State], None]:
    def check(state: State) -> None:
        assert np.isfinite(Configuration(model, state).Ts_world_shape).all()

    return check


def _check_finite(value: Any) -> None:
    assert finite(value) and value


def _dump_rig(rig: CameraRig, path: Path) -> None:
    write_rig_file(rig_file_of(rig), path)


def _write_obj(mesh, path: Path) -> None:
    write_mesh(mesh, path.with_suffix(""))


def yaml_kind(name: str, content: bytes, load, check, dump=None) -> Kind:
    return Kind(name, ".yaml", content, load, check, dump, yaml.safe_load(content))


def text_kind(name: str, suffix: str, text: str | bytes, load, check=_check_finite, dump=None) -> Kind:
    return Kind(name, suffix, text if isinstance(text, bytes) else text.encode(), load, check, dump)


def core_kinds(folder: Path) -> list[Kind]:
    """Rigs, bodies, states and parameters; ``folder`` is where their files lie, and what they refer to."""
    model, slides = crane(), gantry()
    dump_model(model, folder / "crane.yaml")
    dump_model(slides, folder / "gantry.yaml")
    dump_state(State.neutral(model), model, folder / "state.yaml")
    dump_config(TrackerConfig(), folder / "config.yaml")
    write_texture(np.zeros((2, 3, 3), np.uint8), folder / "a.png")
    plain = {"modalities": ["region", "chamfer"], "threads": 2, "chamfer": {"max_iterations": 5}, "region.scales": "6 3 1"}
    return [
        yaml_kind("rig", RIG.encode(), load_rig, _check_rig, _dump_rig),
        yaml_kind("rig_file", RIG.encode(), read_rig_file, lambda value: None, write_rig_file),
        yaml_kind("model", (folder / "crane.yaml").read_bytes(), load_model, _check_model, dump_model),
        yaml_kind("slides", (folder / "gantry.yaml").read_bytes(), load_model, _check_model, dump_model),
        yaml_kind("part", PART.encode(), load_model, _check_model, dump_model),
        yaml_kind("config", (folder / "config.yaml").read_bytes(), load_config, _check_config, dump_config),
        yaml_kind("plain_config", yaml_text(plain).encode(), load_config, _check_config, dump_config),
        yaml_kind(
            "state", (folder / "state.yaml").read_bytes(), lambda path: load_state(path, model), _check_state(model),
            lambda state, path: dump_state(state, model, path),
        ),
        yaml_kind("recording", RECORDING.encode(), load_recording, lambda value: None),
        text_kind("urdf", ".urdf", ROBOT, load_model, _check_model, None),
    ]  # fmt: skip


def _opencv_kind(folder: Path, extension: str) -> Kind:
    """A storage of OpenCV, as it writes it."""
    path = folder / f"storage.{extension}"
    dump_opencv(circle_rig(2), path)
    return text_kind(
        f"opencv_{extension}", path.suffix, path.read_bytes(), lambda file: load_opencv([file]), _check_rig, dump_opencv
    )


def _check_points(points: PointsByCamera) -> None:
    """Finite, with covariances that are some."""
    for camera in points.values():
        people = camera.for_images(640, 480)
        for image in people:
            for person in people[image]:
                assert finite(person) and (person.covariances[:, 0, 0] > 0.0).all() and 0.0 <= person.score <= 1.0
                assert ((person.scores >= 0.0) & (person.scores <= 1.0)).all()


def point_kinds(folder: Path) -> list[Kind]:
    """Points in images, as other programs write them, and what they are on a body."""
    images, parts = point_files.some_people(17, n_images=3, n_people=2), tuple(f"part{i}" for i in range(17))
    write, individuals = point_files, ("mouse1", "mouse2")
    paths = [
        ("points_mmpose", write.write_mmpose_video(folder / "mmpose.json", images, parts)),
        ("points_coco", write.write_coco(folder / "coco.json", images)),
        ("points_mediapipe", write.write_mediapipe_json(folder / "mediapipe.json", point_files.some_people(33, 3, 1), 640, 480)),
        ("points_mediapipe_csv", write.write_mediapipe_csv(folder / "mp.csv", point_files.some_people(33, 3, 1), 640, 480)),
        ("points_deeplabcut", write.write_deeplabcut_csv(folder / "dlc.csv", images, parts, individuals)),
        ("points_deeplabcut_h5", write.write_deeplabcut_h5(folder / "dlc.h5", images, parts, individuals)),
        ("points_sleap", write.write_sleap_csv(folder / "sleap.csv", images, parts)),
        ("points_sleap_h5", write.write_sleap_h5(folder / "sleap.h5", images, parts)),
        ("points_openpose", write.write_openpose_zip(folder / "openpose.zip", images)),
    ]
    dump_keypoint_table(COCO_17, folder / "keypoints.yaml")
    human, table = human_model(), (folder / "keypoints.yaml").read_bytes()
    return [
        *(text_kind(name, path.suffix, path.read_bytes(), load_points, _check_points) for name, path in paths),
        yaml_kind("keypoints", table, lambda path: load_keypoint_table(path, human), _check_finite, dump_keypoint_table),
    ]


def other_kinds(folder: Path) -> list[Kind]:
    """What else is read: OpenCV's storages, meshes, clicks, points, stamps, markers."""
    mesh = write_mesh(tetrahedron(), folder / "valid").read_bytes()

    def load_mesh(path: Path):
        return read_mesh(path, 1.0, path, "file")

    return [
        *(_opencv_kind(folder, extension) for extension in ("yaml", "xml", "json")),
        text_kind("mesh", ".obj", mesh, load_mesh, lambda mesh: _check_finite(mesh.vertices.tolist())),
        text_kind("clicks", ".csv", CLICKS, load_clicks),
        text_kind("control_points", ".csv", CONTROL, load_control_points),
        text_kind("places", ".csv", PLACES, load_places),
        text_kind("table", ".mot", TABLE, load_table, lambda table: _check_finite(table.values.tolist()), dump_table),
        text_kind("stamps", ".csv", STAMPS, lambda path: load_stamp_file(path, "left")),
        text_kind("markers", ".trc", TRC, load_trc, lambda markers: None),
    ]
