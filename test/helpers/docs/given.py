"""What the pages of the documentation take to be there: recordings, films, clicks and runs under the names that they use.

`GIVEN` says with which files a section of a page begins, in a folder that is empty but for them.
"""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import yaml

from helpers.bodies import moving_person, stick_person, textured_plate
from helpers.bodies.openpose_points import write_points
from helpers.cameras import board_films
from helpers.cameras.camera_rigs import circle_rig, disturbed
from helpers.cameras.cross_files import write_control_points, write_lit_cross
from helpers.cameras.moving_balls import write_balls
from helpers.cameras.swinging_disc import write_swinging_disc
from helpers.docs.pages import ROOT, blocks_of
from helpers.docs.place import Place, run
from helpers.sources import bag_samples, projects
from helpers.sources.stream_servers import RtspServer, write_stream
from helpers.sources.v4l2_camera import V4l2Camera
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.images.file_sources import list_images
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.motion.c3d_file import dump_c3d
from tracker_node.loaders.motion.trajectory_file import StateRow, StateTrajectory, Trajectories, read_joints, write_states
from tracker_node.loaders.motion.trc import MarkerTrajectories, dump_trc
from tracker_node.loaders.rig.camera_info import dump_camera_info
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.render.raycast.raycaster import render_color

RATE_HZ = 30.0


def arm(place: Place) -> None:
    place.lay(place.shelf.arm)
    place.lay(place.shelf.arm / "model.yaml", "person.yaml")
    description = "rig: rig.yaml\nmodel: person.yaml\ninitial_state: start.yaml\noutput: described\n"
    (place.folder / "recording.yaml").write_text(description)


def arm_runs(place: Place) -> None:
    arm(place)
    for name in ("out/run", "out/run1", "out/run2"):
        place.lay(place.shelf.arm / "run", name)


def arm_bag(place: Place) -> None:
    arm(place)
    place.lay(place.shelf.arm / "run" / "bag", "out/run1")


def arm_live(place: Place) -> None:
    arm(place)
    place.lay(place.shelf.arm / "run" / "bag", "out/live/bag")


def arm_truth(place: Place) -> None:
    joints = read_joints(place.shelf.arm / "truth.csv")
    write_trc(place.folder / "markers.trc", joints)
    place.lay(place.shelf.arm / "truth.csv", "out/digitized/joints.csv")


def two_arms(place: Place) -> None:
    arm(place)
    for name in ("anna", "bert"):
        place.lay(place.shelf.arm / "model.yaml", f"{name}.yaml")


def two_bodies(place: Place) -> None:
    """One body seen twice: whoever is second hides nothing of the first, and begins where it is."""
    two_arms(place)
    bodies = [f"  {name}: {{model: bert.yaml, initial_state: start.yaml}}" for name in ("anna", "ball")]
    (place.folder / "recording.yaml").write_text("\n".join(["rig: rig.yaml", "output: run1", "bodies:", *bodies]) + "\n")


def trials(place: Place) -> None:
    """The trials of the page: videos and bodies of two subjects."""
    two_arms(place)
    place.lay(place.folder / "rig.yaml", "afternoon.yaml")
    place.lay(place.folder / "start.yaml", "jump.yaml")
    blocks = blocks_of("docs/own_data.md")
    block = next(block for block in blocks if block.section.startswith("Many") and block.language == "yaml")
    (place.folder / "trials.yaml").write_text(block.text)
    given = yaml.safe_load(block.text)
    for trial, entry in given["trials"].items():
        if "recording" in entry:
            (place.folder / trial).mkdir()
            text = "rig: ../rig.yaml\nmodel: ../bert.yaml\ninitial_state: ../start.yaml\noutput: run\n"
            (place.folder / entry["recording"]).write_text(text)
            continue
        folder = place.folder / entry["subject"] / trial
        folder.mkdir(parents=True)
        for camera in load_rig(place.folder / "rig.yaml"):
            write_video(folder / f"{camera.name}.mp4", sorted((place.folder / camera.name).glob("*.png")))


def write_video(path: Path, images: list[Path]) -> None:
    first = cv2.imread(str(images[0]))
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), RATE_HZ, first.shape[1::-1])
    for image in images:
        writer.write(cv2.imread(str(image)))
    writer.release()


def prosthesis(place: Place) -> None:
    """A foot of carbon."""
    seen = '<visual><origin xyz="0.06 0 -0.04"/><geometry><box size="0.22 0.07 0.05"/></geometry></visual>'
    (place.folder / "prosthesis.urdf").write_text(f'<robot name="prosthesis"><link name="left_foot">{seen}</link></robot>\n')


def scaled_arm(place: Place) -> None:
    arm(place)
    (place.folder / "person.yaml").rename(place.folder / "scaled.yaml")


def arm_with_background_images(place: Place) -> None:
    """What ``calibrate background`` starts from, with images of the background alone."""
    arm(place)
    (place.folder / "rig.yaml").rename(place.folder / "rig_refined.yaml")
    for plate in place.folder.glob("*_plate.png"):
        place.lay(plate, f"stills/{plate.name.removesuffix('_plate.png')}.png")


def long_bag(place: Place) -> None:
    """Fifteen seconds of states and poses."""
    (place.folder / "out").mkdir()
    with BagWriter(place.folder / "out/run1") as writer:
        for i in range(round(15.0 * RATE_HZ)):
            stamp_ns = bag_samples.START_NS + i * bag_samples.PERIOD_NS
            writer.write_message("/tracker/state", stamp_ns, bag_samples.tracked_state(stamp_ns))
            writer.write_message("/tracker/pose", stamp_ns, bag_samples.pose(stamp_ns))


def person_run(place: Place) -> None:
    """A run of a person, as if tracked; and a live recording of it."""
    model = human_model()
    moving_person.write_run(place.folder / "out/run", moving_person.moving(60))
    stamps = np.arange(40) * stick_person.PERIOD_NS
    motion = stick_person.Motion(model, stamps, tuple(moving_person.states(model, 40)))
    (place.folder / "recording").mkdir()
    stick_person.write_state_bag(place.folder / "recording/bag", motion)
    dump_model(model, place.folder / "person.yaml")


def static_trial(place: Place) -> None:
    """A person who stands still, and a run that has found exactly that."""
    model = human_model(ankles=True)
    state, stamps = State.neutral(model), np.round(np.arange(5) * 1e9 / RATE_HZ).astype(np.int64)
    positions = np.repeat(Configuration(model, state).landmarks_world[None], 5, axis=0)
    valid = np.ones(positions.shape[:2], dtype=bool)
    write_trc(place.folder / "static.trc", Trajectories(model.landmark_names, stamps, positions, valid))
    (place.folder / "out/static").mkdir(parents=True)
    rows = tuple(StateRow(int(stamp), "TRACKING", "", state.to_values()) for stamp in stamps)
    write_states(place.folder / "out/static/states.csv", StateTrajectory(model.chain.dof_names, rows, model.chain.dof_units))


def write_trc(path: Path, joints: Trajectories) -> None:
    times = joints.stamps_ns * 1e-9
    dump_trc(MarkerTrajectories(joints.names, times, joints.positions_m, RATE_HZ, joints.valid), path)


def person_clip(place: Place) -> None:
    """A person to be tracked, with the files of other programs that say who and where."""
    place.lay(place.shelf.person)
    place.lay(place.shelf.person / "rig.yaml", "rig_with_backgrounds.yaml")
    write_trc(place.folder / "first.trc", read_joints(place.shelf.person / "truth.csv"))


def robot(place: Place) -> None:
    place.lay(place.shelf.robot)
    place.lay(ROOT / "config/models/robot_arm.urdf", "arm.urdf")
    place.lay(place.shelf.robot / "state.yaml", "about.yaml")
    place.lay(place.shelf.robot / "true_states.csv", "moves.csv")
    shipped_files(place)


def new_recording(place: Place) -> None:
    """The folder of a recording that nothing has been made of yet."""
    for camera in load_rig(place.folder / "rig.yaml"):
        (place.folder / "walk/videos").mkdir(parents=True, exist_ok=True)
        images = sorted((place.folder / camera.name).glob("*.png"))
        write_video(place.folder / f"walk/videos/{camera.name}.mp4", images)


def lab(place: Place) -> None:
    """Videos with a calibration of Qualisys, and the true joints as a C3D file."""
    person = place.shelf.person
    run("rig", "export", person / "rig.yaml", "--to", "qualisys", "-o", place.folder / "Calib.qca.txt")
    for camera in load_rig(person / "rig.yaml"):
        (place.folder / "videos").mkdir(exist_ok=True)
        write_video(place.folder / f"videos/{camera.name}.mp4", [Path(image) for image in list_images(str(camera.source))])
    joints = read_joints(person / "truth.csv")
    trajectories = MarkerTrajectories(joints.names, joints.stamps_ns * 1e-9, joints.positions_m, RATE_HZ, joints.valid)
    dump_c3d(trajectories, place.folder / "walk.c3d")
    block = next(block for block in blocks_of("docs/own_data.md") if block.language == "yaml")
    (place.folder / "recording.yaml").write_text(block.text)
    for name, target in (("person.yaml", "person.yaml"), ("state.yaml", "start.yaml")):
        place.lay(person / name, target)


def opencap(place: Place) -> None:
    projects.opencap(place.folder / "OpenCapData")


def shipped_files(place: Place) -> None:
    """The package's ``config/``, as somebody finds it who stands in the source tree."""
    place.lay(ROOT / "config", "config")


def board_recordings(place: Place) -> None:
    place.lay(place.shelf.films)


def control_points(place: Place) -> None:
    points = write_control_points(place.folder / "control_points.csv")
    place.lay(points, "out/object/control_points.csv")
    places = ("a,0,0,0", "b,0.5,0,0", "c,0,0.5,0", "d,0,0,0.5", "e,0.5,0.5,0", "f,0.2,0.1,0.4")
    (place.folder / "object.csv").write_text("\n".join(("point,x,y,z", *places)) + "\n")


def lit_cross(place: Place) -> None:
    write_lit_cross(place.folder)


def calibrations(place: Place) -> None:
    """Calibrations of other programs."""
    write_rig_file(rig_file_of(circle_rig(2)), place.folder / "known.yaml")
    for to, name in (("pose2sim", "Calib.toml"), ("qualisys", "Calib.qca.txt"), ("dlt", "dltcoefs.csv")):
        run("rig", "export", place.folder / "known.yaml", "--to", to, "-o", place.folder / name)
    for name, camera in zip(("left", "right"), circle_rig(2), strict=True):
        dump_camera_info(name, camera.model, place.folder / f"{name}.yaml")
    K = np.array([[900.0, 0.0, 640.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]])
    _write_storage(place.folder / "intrinsics.yml", {"M1": K, "D1": np.zeros((1, 5)), "M2": K, "D2": np.zeros((1, 5))})
    _write_storage(place.folder / "extrinsics.yml", {"R": np.eye(3), "T": np.array([[-0.2], [0.0], [0.0]])})


def _write_storage(path: Path, values: dict[str, np.ndarray]) -> None:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        storage.write(name, value)
    storage.release()


def swinging_disc(place: Place) -> None:
    write_swinging_disc(place.folder, 300)


def balls(place: Place) -> None:
    write_balls(place.folder)


def board_on_the_floor(place: Place) -> None:
    """Two cameras whose world is anywhere; a board that lies still, a wand, a plumb line, and points of known place."""
    rig = CameraRig(board_films.rig().cameras[:2])
    write_rig_file(rig_file_of(rig), place.folder / "rig.yaml")
    for camera, name in zip(rig, "ab", strict=True):
        image = board_films.image_of(camera, board_films.LYING, board_films.pose(0.4, 0.6))
        cv2.imwrite(str(place.folder / f"{name}.png"), image)
    at = np.array([0.0, 0.9, 0.0])
    for file, points in {
        "control_points": {"a": (0, 0, 0), "b": (0.2, 0, 0), "c": (0, 0.2, 0), "d": (0, 0, 0.2)},
        "axes": {"origin": (0, 0, 0), "x": (0.2, 0, 0), "y": (0.05, 0.2, 0)},
        "wand": {"1a": (-0.25, 0, 0), "1b": (0.25, 0, 0), "2a": (-0.25, 0.1, 0.1), "2b": (0.25, 0.1, 0.1)},
        "plumb": {"top": (0.1, 0, 0.2), "bottom": (0.1, 0, -0.1)},
    }.items():
        _write_clicks(place.folder / f"{file}.csv", rig, points, at, with_places=file == "control_points")


def _write_clicks(path: Path, rig: CameraRig, points: dict, at: np.ndarray, with_places: bool) -> None:
    lines = ["camera,point,x,y,z,u,v" if with_places else "camera,point,u,v"]
    for camera in rig:
        for name, point in points.items():
            u, v = camera.project(at + point)[0]
            lines.append(",".join([camera.name, name, *(map(str, point) if with_places else ()), str(u), str(v)]))
    path.write_text("\n".join(lines) + "\n")


def moved_cameras(place: Place) -> None:
    write_points(place.folder / "pose", circle_rig())
    write_rig_file(rig_file_of(disturbed(circle_rig())), place.folder / "rig.yaml")


def plate(place: Place) -> None:
    """A board on a plate before three cameras, and a picture for another one."""
    shipped_files(place)
    cv2.imwrite(str(place.folder / "poster.png"), textured_plate.picture())
    run("calibrate", "texture", "--charuco", "4x5", "--square", "0.054", "--border", "30", "-o", place.folder / "shown.yaml")
    model = load_model(place.folder / "shown.yaml")
    dump_state(textured_plate.TRUE, model, place.folder / "start.yaml")
    rig = textured_plate.rig()
    for camera in rig:
        view = render_color(Configuration(model, textured_plate.TRUE), camera)
        image, (u0, v0, u1, v1) = np.full((camera.model.height, camera.model.width, 3), 128, np.uint8), view.region
        image[v0:v1, u0:u1][view.labels > 0] = view.rgb[view.labels > 0].astype(np.uint8)
        (place.folder / camera.name).mkdir()
        for i in range(3):
            cv2.imwrite(str(place.folder / camera.name / f"{i}.png"), image)
    write_rig_file(rig_file_of(rig).with_cameras({name: {"source": name} for name in rig.names}), place.folder / "rig.yaml")


def live_cameras(place: Place) -> None:
    """A stream on the loopback, a camera whose driver is played, and a rig of both."""
    server = RtspServer(write_stream(place.folder / "stream.ts"))
    place.closing.callback(server.close)
    camera = V4l2Camera(place.folder)
    place.env |= camera.env | {"ROS_HOME": str(place.folder)}
    place.values |= {"rtsp": server.url, "v4l2": str(camera.path)}
    cameras = []
    for name, (width, height) in (("left", (160, 120)), ("right", (64, 48))):
        lens = CameraModel(width, height, np.array([[150.0, 0.0, width / 2], [0.0, 150.0, height / 2], [0.0, 0.0, 1.0]]))
        cameras.append(Camera(name, lens, np.eye(4)))
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), place.folder / "rig.yaml")


GRAPH = ("camera_ingest --rig rig.yaml --loop", "tracker --rig rig.yaml --model person.yaml --initial-state start.yaml")

# (page, section) -> what the section begins with, and commands that run in the background meanwhile
GIVEN: dict[tuple[str, str], tuple[tuple[Callable[[Place], None], ...], tuple[str, ...]]] = {
    ("docs/bodies.md", "A person"): ((static_trial, prosthesis), ()),
    ("docs/bodies.md", "Fit a body to a run"): ((scaled_arm,), ()),
    ("docs/bodies.md", "A plate with a texture"): ((plate,), ()),
    ("docs/bodies.md", "A robot"): ((robot,), ()),
    ("docs/bodies.md", "Look before you track"): ((arm,), ()),
    ("docs/cameras.md", "Import a calibration"): ((calibrations,), ()),
    ("docs/cameras.md", "From a board"): ((board_recordings,), ()),
    ("docs/cameras.md", "From control points"): ((control_points,), ()),
    ("docs/cameras.md", "Sources"): ((live_cameras,), ()),
    ("docs/cameras.md", "Check the rig"): ((balls,), ()),
    ("docs/cameras.md", "Set the world"): ((board_on_the_floor,), ()),
    ("docs/cameras.md", "Check and mend the poses of the cameras"): ((moved_cameras,), ()),
    ("docs/cameras.md", "By a tracked run"): ((scaled_arm,), ()),
    ("docs/cameras.md", "Clocks"): ((swinging_disc,), ()),
    ("docs/cameras.md", "Backgrounds"): ((arm_with_background_images,), ()),
    ("docs/cameras.md", "Lights"): ((lit_cross,), ()),
    ("docs/cameras.md", "Images without distortion"): ((arm,), ()),
    ("docs/nodes.md", "pipeline"): ((arm,), ()),
    ("docs/nodes.md", "Several bodies"): ((two_bodies,), ()),
    ("docs/nodes.md", "Record"): ((arm,), GRAPH),
    ("docs/nodes.md", "Play"): ((long_bag,), ()),
    ("docs/nodes.md", "Track again"): ((arm_bag,), ()),
    ("docs/nodes.md", "Watch it"): ((arm_runs, arm_bag), ()),
    ("docs/own_data.md", "A project of another program"): ((opencap,), ()),
    ("docs/own_data.md", "A lab with markers"): ((lab,), ()),
    ("docs/own_data.md", "Track them"): ((trials,), ()),
    ("docs/results.md", "Evaluate"): ((arm_runs, arm_live, arm_truth), ()),
    ("docs/results.md", "Export"): ((person_run,), ()),
    ("docs/studio.md", "Studio: set a pose, digitize, play back, watch"): (
        (arm_runs, arm_truth, control_points, new_recording),
        (),
    ),
    ("docs/tracking.md", "Choose what is compared"): ((arm,), GRAPH),
    ("docs/tracking.md", "Several bodies"): ((two_bodies,), ()),
    ("docs/tracking.md", "Start without a pose"): ((arm,), ()),
}
