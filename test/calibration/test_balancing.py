"""The Balancing sample: its rigs from the real files, and what the refinement does for a blob that it does not see."""

import shutil

import cv2
import numpy as np
import pytest

from benchmark.calibration._time import cap_centers, cap_rms_px
from tracker_node.calibration import balancing
from tracker_node.loaders.fetched_files import SAMPLES
from tracker_node.loaders.rig.rig_yaml import load_rig


@pytest.fixture(scope="module")
def sample(shared_data, tmp_path_factory):
    """The sample's folder, from a copy of its files instead of the package index."""
    folder = tmp_path_factory.mktemp("balancing")
    source = shared_data / "pose2sim_balancing"
    names = {
        "Pose2Sim_cameras.toml": "calibration.toml",
        "openpose_body25b_json.zip": "points2d.zip",
        **{f"videos/cam{i:02d}.mp4": f"videos/cam{i:02d}.mp4" for i in range(1, 5)},
        **{f"background_ext/cam{i:02d}_ext.png": f"stills/cam{i:02d}.png" for i in range(1, 5)},
    }
    balancing.copy_files({new: source / old for old, new in names.items()}, folder)
    return folder


@pytest.fixture(scope="module")
def refinement(sample):
    return balancing.write_rigs(sample)


def test_the_refinement_makes_the_joints_agree(refinement):
    """Known from two independent programs: rms 17 to 19 px before, 9 to 13 after; median 10.9 before, 6.3 after (all joints)."""
    assert refinement.converged
    moved = refinement.cameras["cam03"]  # the camera that the calibration has wrong
    assert moved.median_before_px > 15.0 and moved.median_after_px < 8.0
    for figures in refinement.cameras.values():
        assert figures.median_after_px < 8.0
        assert figures.moved_m < 0.15
        assert abs(figures.lag_images) < 0.1


def test_a_blob_that_was_not_in_the_fit_agrees_too(sample, refinement):
    """The swim cap, found by its color in the videos: 12.2 px before, 6 to 9 after."""
    centers = np.array([cap_centers(camera.source) for camera in load_rig(sample / "rig.yaml")]).transpose(1, 0, 2)
    before, after = (cap_rms_px(load_rig(sample / name), centers) for name in ("rig.yaml", "rig_refined.yaml"))
    assert before > 10.0
    assert after < 7.0


def test_the_rigs_fit_the_videos(sample, refinement):
    for name in ("rig.yaml", "rig_refined.yaml"):
        for camera in load_rig(sample / name):
            capture = cv2.VideoCapture(camera.source)
            size = capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
            assert size == (camera.model.width, camera.model.height), (name, camera.name)


def test_a_plate_has_the_videos_pixels(sample, refinement):
    """Nothing moves in the upper quarter of the image: the plate is there what the video shows."""
    folder = sample / "one_camera"
    for name in ("videos/cam02.mp4", "stills/cam02.png"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(sample / name, folder / name)
    shutil.copyfile(sample / "calibration.toml", folder / "calibration.toml")
    assert not balancing.has_backgrounds(folder)
    balancing.write_backgrounds(folder, ("cam02",))
    assert balancing.has_backgrounds(folder)
    background = cv2.imread(str(folder / "backgrounds/cam02.png"))
    image = cv2.VideoCapture(str(folder / "videos/cam02.mp4")).read()[1]
    assert background.shape == image.shape == (1920, 1080, 3)
    difference = cv2.absdiff(background, image).max(axis=2)
    assert np.percentile(difference[:400], 99) < 20


def test_sample_and_shared_files_are_the_same_bytes(shared_data):
    """Digests that the sample asks for, against files that came another way."""
    import hashlib

    folder = shared_data / "pose2sim_balancing"
    places = {"videos": "videos/{}.mp4", "static": "static_tpose/{}.mp4", "stills": "background_ext/{}_ext.png"}
    n_checked = 0
    for member in SAMPLES["balancing"]:
        kind, _, file = member.name.partition("/")
        path = folder / places[kind].format(file.split(".")[0]) if kind in places else None
        path = {"calibration.toml": folder / "Pose2Sim_cameras.toml"}.get(member.name, path)
        if path is not None:
            assert hashlib.sha256(path.read_bytes()).hexdigest() == member.sha256, member.name
            n_checked += 1
    assert n_checked == 13
