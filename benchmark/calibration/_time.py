"""Sections `offset` and `balancing` of the calibration benchmark: the clock of a free-running camera, and a real rig refined."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from tracker_node.calibration import balancing
from tracker_node.calibration.clocks.motion import MotionMeter
from tracker_node.calibration.clocks.offsets import estimate_clocks
from tracker_node.calibration.points.bundle_adjustment import AdjustmentOptions, PointObservations, adjust
from tracker_node.calibration.points.rig_refinement import load_joints, refine_rig
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.camera.rig import CameraRig
from tracker_node.cli.main import main as command
from tracker_node.loaders.images.source import open_camera_source
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.synthesis.motions.deepmimic import load_motion
from tracker_node.synthesis.motions.motion import Motion
from tracker_node.synthesis.recording import Request, default_motions, produce, show_progress
from tracker_node.synthesis.scenes.rasterizer import ColoredMesh
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.mannequin import LANDMARKS, MannequinSubject

Figures = dict[str, float | int]

RATE_HZ, N_IMAGES, CLIP = 60.0, 150, "dance_a"
SCENE = SceneConfig(n_cameras=4, backgrounds=False)
FREE = 2  # number of the camera that runs freely
FINE = 100  # time steps to choose from, per image period
CACHE = Path("out/calibration")
SHIFT_NS, SHIFTED, LOST = 271_300_000, "cam04", (30, 31, 60)  # of the real clip: what is done to one camera
CAP_STEP = 10  # the swim cap is looked for in every so-manieth image
MEASURE_PX = 30.0  # robust scale with which joints are placed for the figures
MIN_CONFIDENCE = 0.3


def offset_section() -> Figures:
    """A camera that runs freely beside three that are triggered together; and the Balancing clip with one camera's stamps moved.

    The first: the mannequin, drawn by OpenGL, by videos alone (`synchronize`), then by the tracked body as well
    (`track`, `calibrate body`, `track`, `calibrate refine --from-run`). ``error_ms`` is what the videos alone
    leave, of the free camera against the mean of the others, ``body_error_ms`` what is left after the body, which is not always
    less: the mannequin is dressed, and not the tracker's model.
    """
    if default_motions() is None:
        print("offset: skipped, needs the motions in the folder that TRACKER_SHARED_DATA names")
        return {}
    folder = CACHE / f"free_running_{CLIP}_{N_IMAGES}"
    true_s = record_free_running(folder)
    rigs = {name: folder / f"rig_{name}.yaml" for name in ("timed", "refined")}
    _run("synchronize", "--rig", folder / "rig.yaml", "-o", rigs["timed"], "--force", "--quiet")
    config = folder / "tracker.yaml"
    config.write_text(f"synchronizer: {{tolerance: 0.6, image_period_s: {1.0 / RATE_HZ:.7f}}}\n", encoding="utf-8")
    with tempfile.TemporaryDirectory() as scratch:
        runs = [Path(scratch) / "first", Path(scratch) / "second"]
        track = ("track", "--quiet", "--rig", rigs["timed"], "--initial-state", folder / "state.yaml", "--config", config)
        _run(*track, "--model", folder / "subject/person.yaml", "--output", runs[0])
        fitted = folder / "person_fitted.yaml"
        _run("calibrate", "body", "--from-run", runs[0], "-o", fitted, "--force", "--quiet")
        _run(*track, "--model", fitted, "--output", runs[1])
        _run("calibrate", "refine", "--from-run", runs[1], "--keep-places", "-o", rigs["refined"], "--force", "--quiet")
    timed = json.loads(rigs["timed"].with_suffix(".json").read_text(encoding="utf-8"))["metrics"]
    refined = json.loads(rigs["refined"].with_suffix(".json").read_text(encoding="utf-8"))["metrics"]
    name = load_rig(folder / "rig.yaml").names[FREE]
    return {
        "offset.true_ms": 1e3 * true_s,
        "offset.error_ms": abs(1e3 * (_offset_s(rigs["timed"]) - true_s)),
        "offset.sigma_ms": timed[f"time.{name}.offset_sigma_ms"],
        "offset.body_error_ms": abs(1e3 * (_offset_s(rigs["refined"]) - true_s)),
        "offset.body_sigma_ms": refined[f"refine.{name}.later_sigma_ms"],
        **_real_offset(),
    }


def _run(*arguments: str | Path) -> None:
    """A command; 1 is that of a run in which not all went well, here that a camera ends before the free one."""
    status = command([str(a) for a in arguments])
    if status not in (0, 1 if arguments[0] == "track" else 0):
        raise SystemExit(f"tracker_node {' '.join(str(a) for a in arguments)}: exit status {status}")


def _offset_s(rig_path: Path) -> float:
    """Of the free camera against the mean of the others."""
    offsets = [1e-9 * camera.time_offset_ns for camera in load_rig(rig_path)]
    return offsets[FREE] - float(np.mean([o for i, o in enumerate(offsets) if i != FREE]))


def record_free_running(folder: Path) -> float:
    """Film the mannequin with four cameras at 60 Hz, of which one exposes at times of its own; its true offset, seconds.

    ``rig.yaml`` knows nothing of that. All images are of one motion; nothing but their times differs. Beside it come
    ``person.yaml``, the tracker's model scaled by a T-pose, and ``state.yaml``, the pose at the beginning.
    """
    late = int(np.random.default_rng(20).integers(5 * FINE, 20 * FINE))
    done = folder / "true_offset.json"
    if done.exists():
        return float(json.loads(done.read_text(encoding="utf-8"))["offset_s"])
    fine = load_motion(CLIP, RATE_HZ * FINE, FINE * N_IMAGES + late, default_motions())
    bound = FINE * np.arange(N_IMAGES)
    times = np.unique(np.r_[bound, bound + late])
    rig = make_rig(SCENE)
    rig = CameraRig(tuple(replace(camera, source=f"{camera.name}.avi") for camera in rig), rig.world_frame)
    folder.mkdir(parents=True, exist_ok=True)
    write_rig_file(rig_file_of(rig), folder / "rig.yaml")
    start = _film(folder, rig, Motion(CLIP, RATE_HZ, fine.root_positions[times], fine.rotations[times]), times, late)
    request = Request(motion=CLIP, n_images=1, rate_hz=RATE_HZ, motions=default_motions(), scene=SCENE)
    produce(request, folder / "subject")
    model = load_model(folder / "subject/person.yaml")
    dump_state(fit_state_to_landmarks(model, start).state, model, folder / "state.yaml")
    done.write_text(json.dumps({"offset_s": late / (RATE_HZ * FINE)}) + "\n", encoding="utf-8")
    return late / (RATE_HZ * FINE)


def _film(folder: Path, rig: CameraRig, motion: Motion, times: np.ndarray, late: int) -> dict[str, np.ndarray]:
    """Write the videos; landmarks at the beginning."""
    free = rig.names[FREE]
    groups = [([n for n in rig.names if n != free], 0), ([free], late)]
    size, code = (SCENE.width, SCENE.height), cv2.VideoWriter.fourcc(*"MJPG")
    videos = {n: cv2.VideoWriter(str(folder / f"{n}.avi"), code, RATE_HZ, size) for n in rig.names}
    studios = [(Studio(rig.subset(names), SCENE), first) for names, first in groups]
    subject, start = MannequinSubject(), {}
    for done, (time, body) in enumerate(zip(times, subject.follow(motion), strict=True), start=1):
        start = start or dict(zip(LANDMARKS, body.landmarks, strict=True))
        mesh = ColoredMesh(body.vertices, subject.faces, subject.colors_rgb)
        for studio, first in studios:
            number, rest = divmod(int(time) - first, FINE)
            if rest == 0 and 0 <= number < N_IMAGES:
                for name, image in zip(studio.rig.names, studio.images(mesh, number), strict=True):
                    videos[name].write(image)
        show_progress(done, len(times))
    for video in videos.values():
        video.release()
    for studio, _ in studios:
        studio.__exit__()
    return start


def _real_offset() -> Figures:
    """The Balancing clip, whose cameras are triggered together: one camera's stamps are moved, and it loses some images."""
    recording = balancing_folder()
    if recording is None:
        return {}
    rig = load_rig(refined_balancing(recording)[1])
    motions = []
    for camera in rig:
        images = open_camera_source(camera)
        if camera.name == SHIFTED:
            images = ((stamp + SHIFT_NS, image) for i, (stamp, image) in enumerate(images) if i not in LOST)
        motions.append(MotionMeter(camera.name, [n for n in rig.names if n != camera.name], rig).measure(images))
    found = estimate_clocks(motions).cameras
    others = float(np.mean([clock.offset_s for name, clock in found.items() if name != SHIFTED]))
    return {
        "offset.balancing_error_ms": abs(1e3 * (found[SHIFTED].offset_s - others) + 1e-6 * SHIFT_NS),
        "offset.balancing_sigma_ms": 1e3 * found[SHIFTED].offset_sigma_s,
    }


def balancing_section() -> Figures:
    """The Balancing rig as shipped and as `calibrate refine --points2d` makes it of the 2D joints, by those and by the swim cap.

    The median is of the lengths of residuals of joints of a confidence of at least 0.3, placed with a Cauchy loss 30 px wide: the
    shipped rig then has the 10.9 px that are known of it. Beside it by least squares, which joints on the wrong limb pull about.
    The swim cap, found by its color, has no part in the fit. ``held_out_*``: the refinement sees one half of the clip, and the
    joints of the other half are judged; mean of both ways.
    """
    recording = balancing_folder()
    if recording is None:
        print("balancing: skipped, needs the recording pose2sim_balancing in the folder that TRACKER_SHARED_DATA names")
        return {}
    rig = balancing.named_rig(recording / "calibration.toml")
    joints = load_joints(recording / "points2d.zip", rig)
    paths = refined_balancing(recording)
    caps = np.array([cap_centers(str(camera.source)) for camera in load_rig(paths[0])]).transpose(1, 0, 2)
    half = len(joints) // 2
    ways = [(joints[:half], joints[half:]), (joints[half:], joints[:half])]
    held_out = [joint_median_px(refine_rig(rig, fit).rig, judged) for fit, judged in ways]
    figures: Figures = {}
    for name, path in zip(("shipped_", ""), paths, strict=True):
        placed = {camera.name: camera.T_world_cam for camera in load_rig(path)}
        in_calibration_pixels = CameraRig(tuple(replace(c, T_world_cam=placed[c.name]) for c in rig), rig.world_frame)
        figures[f"balancing.{name}reprojection_median_px"] = joint_median_px(in_calibration_pixels, joints)
        figures[f"balancing.{name}least_squares_median_px"] = joint_median_px(in_calibration_pixels, joints, 1e5)
        figures[f"balancing.{name}cap_rms_px"] = cap_rms_px(load_rig(path), caps)
    return figures | {"balancing.held_out_reprojection_median_px": float(np.mean(held_out))}


def balancing_folder() -> Path | None:
    """The sample's files under the names of the sample command, in the cache; None where the recording is not there."""
    shared = Path(os.environ.get("TRACKER_SHARED_DATA", "")) / "pose2sim_balancing"
    if not os.environ.get("TRACKER_SHARED_DATA") or not shared.is_dir():
        return None
    names = {"Pose2Sim_cameras.toml": "calibration.toml", "openpose_body25b_json.zip": "points2d.zip"}
    names |= {f"videos/cam{i:02d}.mp4": f"videos/cam{i:02d}.mp4" for i in range(1, 5)}
    folder = CACHE / "balancing"
    balancing.copy_files({new: shared / old for old, new in names.items()}, folder)
    return folder


def refined_balancing(folder: Path) -> tuple[Path, Path]:
    """The rig files as shipped and as refined by the command."""
    shipped, refined = folder / "rig.yaml", folder / "rig_refined.yaml"
    write_rig_file(balancing.rig_file(balancing.named_rig(folder / "calibration.toml"), "videos"), shipped)
    points = ("--points2d", folder / "points2d.zip", "--pixels", "calibration")
    _run("calibrate", "refine", "--rig", shipped, *points, "-o", refined, "--force")
    return shipped, refined


def joint_median_px(rig: CameraRig, joints: np.ndarray, robust_px: float = MEASURE_PX) -> float:
    """Median distance of the joints (n_images, n_joints, n_cameras, 3) from where the rig puts them."""
    flat = joints.reshape(-1, *joints.shape[2:])
    weights = np.where(flat[..., 2] >= MIN_CONFIDENCE, flat[..., 2], 0.0)
    placed = AdjustmentOptions(free_cameras=False, robust_scale_px=robust_px)
    found = adjust(rig, PointObservations(flat[..., :2], weights), placed)
    distances = np.linalg.norm(found.residuals_px, axis=-1)
    return float(np.median(distances[(weights > 0.0) & found.valid[:, None]]))


def cap_rms_px(rig: CameraRig, centers: np.ndarray) -> float:
    """Root mean square distance of the cap's centers (n, n_cameras, 2) from where the rig puts them."""
    placed = AdjustmentOptions(free_cameras=False, robust_scale_px=100.0)
    found = adjust(rig, PointObservations(centers, np.ones(centers.shape[:2])), placed)
    return float(np.sqrt(np.mean(np.sum(found.residuals_px**2, axis=-1))))


def cap_centers(video: str, step: int = CAP_STEP) -> list[np.ndarray]:
    """Centers of the largest teal blob, in the video's pixels, of every ``step``-th image."""
    capture, centers = cv2.VideoCapture(video), []
    for i in range(100):
        if not capture.grab():
            break
        if i % step == 0:
            image = capture.retrieve()[1][:900]
            mask = cv2.inRange(cv2.cvtColor(image, cv2.COLOR_BGR2HSV), (80, 90, 40), (105, 255, 220))
            mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((5, 5)))
            _, _, stats, centroids = cv2.connectedComponentsWithStats(mask)
            centers.append(centroids[1 + stats[1:, cv2.CC_STAT_AREA].argmax()])
    return centers
