"""People in the images of offline runs: when and where a detector looks, and that threads do not matter."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.cameras.person_clip import TrueDetector, make_person_clip
from helpers.cameras.small_clip import Clip
from helpers.one_run import run_offline
from helpers.sources.weights import weights_or_skip
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.motion.trajectory_file import read_joints
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.crop import Crop
from tracker_node.observation.keypoints.people import People
from tracker_node.runs.config_file import load_config
from tracker_node.runs.load import load_run
from tracker_node.runs.offline import OfflineRun
from tracker_node.runs.people.detection import DetectionOptions, PeopleDetection
from tracker_node.tracking.config import TrackerConfig

N_IMAGES = 6
CONFIG = TrackerConfig(modalities=("region", "keypoints"))


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    return make_person_clip(tmp_path_factory.mktemp("clip") / "person", N_IMAGES)


def run_of(clip: Clip, detector: TrueDetector, **changes: Any) -> OfflineRun:
    given = {
        "rig": load_rig(clip.rig_file), "model": clip.model, "config": load_config(clip.config_file),
        "initial_state": clip.states[0], "detection": DetectionOptions(make=lambda: detector),
    }  # fmt: skip
    return OfflineRun(**{**given, **changes})


@pytest.fixture(scope="module")
def finished(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], TrueDetector]:
    output, detector = tmp_path_factory.mktemp("finished") / "run", TrueDetector(clip)
    return output, run_offline(run_of(clip, detector), output), detector


def test_a_detector_looks_at_every_image_where_the_body_is_expected(
    clip: Clip, finished: tuple[Path, dict[str, Any], TrueDetector]
) -> None:
    _, summary, detector = finished
    assert sorted((camera, number) for camera, number, _ in detector.asked) == [
        (camera, number) for camera in clip.rig.names for number in range(N_IMAGES)
    ]
    for camera, number, crops in detector.asked:
        (crop,) = crops  # the start is given: the body is known from the first image on
        hip = clip.rig[camera].project(clip.states[number].T_world_root[None, :3, 3])[0][0]
        assert np.linalg.norm(hip - crop.center) < 20.0 and 100.0 < crop.size < 300.0
    assert summary["detection"]["images"] == 3 * N_IMAGES and summary["detection"]["every_sets"] == 1
    assert summary["status_counts"]["TRACKING"] == N_IMAGES


def test_the_person_is_tracked(clip: Clip, finished: tuple[Path, dict[str, Any], TrueDetector]) -> None:
    joints = read_joints(finished[0] / "joints.csv")
    truth = np.array([Configuration(clip.model, state).landmarks_world for state in clip.states])
    errors_m = np.linalg.norm(joints.positions_m - truth, axis=2)
    assert errors_m.mean() < 0.03 and errors_m.max() < 0.12


def test_the_number_of_threads_does_not_matter(
    clip: Clip, finished: tuple[Path, dict[str, Any], TrueDetector], tmp_path: Path
) -> None:
    config = replace(load_config(clip.config_file), threads=1)
    run_offline(run_of(clip, TrueDetector(clip), config=config), tmp_path / "run")
    assert (tmp_path / "run/states.csv").read_bytes() == (finished[0] / "states.csv").read_bytes()


def test_no_modality_no_detector(clip: Clip, tmp_path: Path) -> None:
    detector = TrueDetector(clip)
    config = replace(load_config(clip.config_file), modalities=("region",))
    summary = run_offline(run_of(clip, detector, config=config, max_sets=2), tmp_path / "run")
    assert not detector.asked and "detection" not in summary


def test_points_alone_have_residuals_in_pixels(clip: Clip, tmp_path: Path) -> None:
    config = replace(load_config(clip.config_file), modalities=("keypoints",))
    summary = run_offline(run_of(clip, TrueDetector(clip), config=config, max_sets=2), tmp_path / "run")
    with BagReader(tmp_path / "run/bag") as reader:
        units = {message.residual_unit for _, message in reader.decoded("/tracker/state")}
    assert units == {summary["residual_unit"]} == {"px"}
    assert load_run(tmp_path / "run").residual_key == "residual_px"


class Everywhere:
    """A tracker that knows nothing."""

    def expected_crops(self, stamp_ns: int) -> list[tuple[Crop, ...]]:
        return [(), (), ()]


def image_sets(clip: Clip, n: int, people: People | None = None) -> list[ImageSet]:
    import cv2

    sets = []
    for i in range(n):
        pixels = {name: cv2.imread(str(clip.folder / name / f"{i:04d}.png")) for name in clip.rig.names}
        sets.append(ImageSet(100 * i, tuple(CameraImage(name, 100 * i, pixels[name], people=people) for name in pixels)))
    return sets


def test_every_second_set_counted_anew_where_stamps_go_back(clip: Clip) -> None:
    detector = TrueDetector(clip)
    detection = PeopleDetection(clip.rig, CONFIG, DetectionOptions(every_sets=2, make=lambda: detector))
    first, second, third = image_sets(clip, 3)
    seen = [detection.with_people(Everywhere(), each).images[0].people is not None for each in (first, second, third, first)]
    assert seen == [True, False, True, True]
    assert all(crops == () for _, _, crops in detector.asked)  # the whole image, where nothing is known
    alone = replace(CONFIG, modalities=("keypoints",))
    with pytest.raises(TrackerError, match="every 2th image set take the modality region beside"):
        PeopleDetection(clip.rig, alone, DetectionOptions(every_sets=2, make=lambda: detector))
    with pytest.raises(ValueError, match="every_sets of 1 or more"):
        DetectionOptions(every_sets=0)


class Here(Everywhere):
    """A tracker that takes the body to be where cam01 shows it, where cam02 shows nobody, and out of sight of cam03."""

    def expected_crops(self, stamp_ns: int) -> list[tuple[Crop, ...]]:
        return [(Crop((100.0, 100.0), 200.0),), (Crop((5.0, 5.0), 4.0),), ()]


def test_where_nobody_is_in_the_crop_the_whole_image_is_searched(clip: Clip) -> None:
    class Narrow(TrueDetector):
        def detect(self, image: np.ndarray, expected: Any = ()) -> People:
            found = super().detect(image, expected)
            return () if expected and expected[0].size < 10.0 else found

    detector = Narrow(clip)
    detection = PeopleDetection(clip.rig, replace(CONFIG, threads=1), DetectionOptions(make=lambda: detector))
    found = detection.with_people(Here(), image_sets(clip, 1)[0])
    asked = [(camera, len(crops)) for camera, _, crops in detector.asked]
    assert asked == [("cam01", 1), ("cam02", 1), ("cam02", 0), ("cam03", 0)]
    assert [len(image.people or ()) for image in found.images] == [1, 1, 1] and len(detection.ms) == 3


def test_people_that_are_there_already_are_left_alone(clip: Clip) -> None:
    detector = TrueDetector(clip)
    detection = PeopleDetection(clip.rig, CONFIG, DetectionOptions(make=lambda: detector))
    (given,) = image_sets(clip, 1, people=())
    assert detection.with_people(Everywhere(), given) is given
    without = replace(given.images[1], people=None)
    found = detection.with_people(Everywhere(), replace(given, images=(given.images[0], without, given.images[2])))
    assert [len(image.people or ()) for image in found.images] == [0, 1, 0]
    assert [camera for camera, _, _ in detector.asked] == ["cam02"]


def test_impossible_points_of_a_detector_are_as_if_not_found(clip: Clip) -> None:
    class Broken(TrueDetector):
        def detect(self, image: np.ndarray, expected: Any = ()) -> People:
            (person,) = super().detect(image, expected)
            person.pixels[23] = np.nan
            return (person,)

    detection = PeopleDetection(clip.rig, CONFIG, DetectionOptions(make=lambda: Broken(clip)))
    image = detection.with_people(Everywhere(), image_sets(clip, 1)[0]).images[0]
    assert image.people is not None and image.people[0].scores[23] == 0.0 and np.isfinite(image.people[0].pixels).all()


def test_a_network_of_another_kind_is_refused(clip: Clip, tmp_path: Path) -> None:
    files = weights_or_skip()
    (tmp_path / "mine.tflite").symlink_to(files.detector)
    with pytest.raises(FileFormatError, match=r"mine.tflite: field '\(network\)': expected a network with the inputs") as caught:
        PeopleDetection(clip.rig, CONFIG, DetectionOptions(tmp_path / "mine.tflite"))
    assert "\n" not in str(caught.value)


def test_the_network_sees_nobody_in_noise_with_any_number_of_threads(clip: Clip) -> None:
    weights_or_skip()
    noise = np.random.default_rng(1).integers(0, 256, (200, 200, 3), dtype=np.uint8)
    given = ImageSet(0, tuple(CameraImage(name, 0, noise[:, :, ::-1], "rgb8") for name in clip.rig.names))
    for threads in (1, 2):
        detection = PeopleDetection(clip.rig, replace(CONFIG, threads=threads), DetectionOptions())
        found = detection.with_people(Everywhere(), given)
        assert [image.people for image in found.images] == [(), (), ()]
        assert detection.summary()["detector"] == "BlazePose full" and detection.summary()["images"] == 3
