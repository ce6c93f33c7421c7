"""People in the bag of a run: what was found is kept, and the states are made again from it bit for bit."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from helpers.cameras.person_clip import TrueDetector, make_person_clip, true_person
from helpers.cameras.small_clip import Clip
from helpers.one_run import run_offline
from helpers.sources.sample import sample_or_skip
from helpers.sources.weights import weights_or_skip
from tracker_node.cli.main import main
from tracker_node.loaders.bag.message_types import KEYPOINTS, message_of, stamp_ns_of
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.observation.image_set import CameraImage
from tracker_node.observation.keypoints.crop import Crop
from tracker_node.observation.keypoints.people import People
from tracker_node.runs.config_file import load_config
from tracker_node.runs.messages import IMAGE, image, keypoints, people_of
from tracker_node.runs.offline import OfflineRun
from tracker_node.runs.people.detection import DetectionOptions

N_IMAGES = 5
BASE_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    return make_person_clip(tmp_path_factory.mktemp("clip") / "person", N_IMAGES)


class NotAsked:
    def detect(self, image: np.ndarray, expected: Sequence[Crop] = ()) -> People:
        raise AssertionError("there are people in the bag")


def tracked(clip: Clip, output: Path, **changes: Any) -> dict[str, Any]:
    given = {
        "rig": load_rig(clip.rig_file), "model": clip.model, "config": load_config(clip.config_file),
        "initial_state": clip.states[0], "asked": {"rig": str(clip.rig_file)},
    }  # fmt: skip
    return run_offline(OfflineRun(**{**given, **changes}), output)


def again(clip: Clip, output: Path, run: Path, **changes: Any) -> dict[str, Any]:
    return tracked(clip, output, bag=run / "bag", from_run=True, detection=DetectionOptions(make=NotAsked), **changes)


@pytest.fixture(scope="module")
def run(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every second image set with points."""
    output, detector = tmp_path_factory.mktemp("finished") / "run", TrueDetector(clip)
    tracked(clip, output, detection=DetectionOptions(every_sets=2, make=lambda: detector))
    return output


def test_the_bag_holds_the_people_of_the_sets_used(clip: Clip, run: Path) -> None:
    with BagReader(run / "bag") as reader:
        found = [message for _, message in reader.decoded("/cam02/keypoints")]
        assert set(reader.topics_of_type(KEYPOINTS)) == {f"/{name}/keypoints" for name in clip.rig.names}
        states = [message for _, message in reader.decoded("/tracker/state")]
    stamps = [stamp_ns_of(state.header.stamp) for state in states]
    assert [stamp_ns_of(message.header.stamp) for message in found] == stamps[::2]
    (person,) = people_of(found[1])
    expected = true_person(clip, clip.rig["cam02"], 2)
    assert person.pixels.tobytes() == expected.pixels.tobytes()
    assert person.silhouette is not None and expected.silhouette is not None
    assert np.array_equal(person.silhouette.probabilities, expected.silhouette.probabilities)
    assert found[0].header.frame_id == clip.rig["cam02"].frame_id and found[0].camera == "cam02"


def test_silhouettes_take_little_room(run: Path) -> None:
    with BagReader(run / "bag") as reader:
        raw = sum(m.persons[0].silhouette.data.size for _, m in reader.decoded("/cam01/keypoints"))
    assert sum(path.stat().st_size for path in (run / "bag").iterdir()) < 500_000 + 0.1 * raw


def test_the_same_states_from_the_bag_without_a_detector(clip: Clip, run: Path, tmp_path: Path) -> None:
    summary = again(clip, tmp_path / "again", run)
    assert not summary["errors"] and "detection" not in summary
    assert (tmp_path / "again/states.csv").read_bytes() == (run / "states.csv").read_bytes()
    again(clip, tmp_path / "third", tmp_path / "again")  # a run made again keeps them, too
    assert (tmp_path / "third/states.csv").read_bytes() == (run / "states.csv").read_bytes()


def test_points_matter(clip: Clip, run: Path, tmp_path: Path) -> None:
    """Or the test before would say nothing."""
    config = replace(load_config(clip.config_file), modalities=("region",))
    tracked(clip, tmp_path / "contours", config=config)
    assert (tmp_path / "contours/states.csv").read_bytes() != (run / "states.csv").read_bytes()


def test_a_run_without_points_is_tracked_again_with_a_detector(clip: Clip, tmp_path: Path) -> None:
    config = replace(load_config(clip.config_file), modalities=("region",))
    tracked(clip, tmp_path / "contours", config=config)
    with BagReader(tmp_path / "contours/bag") as reader:
        assert not reader.topics_of_type(KEYPOINTS)
    detector = TrueDetector(clip)
    options = DetectionOptions(make=lambda: detector)
    tracked(clip, tmp_path / "again", bag=tmp_path / "contours/bag", from_run=True, detection=options)
    assert len(detector.asked) == 3 * N_IMAGES


def test_a_run_to_which_no_points_came_is_made_again_without_any(clip: Clip, tmp_path: Path) -> None:
    config = replace(load_config(clip.config_file), modalities=("region",))
    tracked(clip, tmp_path / "live", config=config)
    summary = json.loads((tmp_path / "live/run.json").read_text())
    summary["parameters"]["modalities"].append("keypoints")  # as of a live run whose detector was too slow
    (tmp_path / "live/run.json").write_text(json.dumps(summary))
    assert "detection" not in again(clip, tmp_path / "again", tmp_path / "live")


def bag_of_images(clip: Clip, path: Path, broken: tuple[str, ...] = ()) -> Path:
    """With the people in every second image, told a while after it; points are missing in messages of ``broken`` cameras."""
    with BagWriter(path) as writer:
        for number in range(N_IMAGES):
            for camera in clip.rig:
                stamp_ns = BASE_NS + number * 33_333_333
                pixels = cv2.imread(str(clip.folder / camera.name / f"{number:04d}.png"))
                writer.write_message(f"/{camera.name}/image_raw", stamp_ns, message_of(IMAGE, image(stamp_ns, "", pixels)))
                if number % 2 == 0:
                    found = CameraImage(camera.name, stamp_ns, pixels, people=(true_person(clip, camera, number),))
                    message = message_of(KEYPOINTS, keypoints(found, camera.frame_id))
                    if camera.name in broken:
                        message.persons[0].u = np.zeros(3)
                    writer.write_message(f"/{camera.name}/keypoints", stamp_ns + 100_000_000, message)
    return path


def test_people_in_a_bag_of_images_are_used_and_the_others_detected(clip: Clip, tmp_path: Path) -> None:
    bag, detector = bag_of_images(clip, tmp_path / "images"), TrueDetector(clip)
    options = DetectionOptions(make=lambda: detector)
    summary = tracked(clip, tmp_path / "run", bag=bag, detection=options)
    assert not summary["errors"] and summary["image_sets"] == N_IMAGES
    assert {number for _, number, _ in detector.asked} == {1, 3} and len(detector.asked) == 2 * 3
    with BagReader(tmp_path / "run/bag") as reader:
        assert reader.topics["/cam01/keypoints"].message_count == N_IMAGES


def test_points_that_contradict_themselves_are_left_out_and_told_once(clip: Clip, tmp_path: Path) -> None:
    bag, detector = bag_of_images(clip, tmp_path / "images", broken=("cam02",)), TrueDetector(clip)
    summary = tracked(clip, tmp_path / "run", bag=bag, detection=DetectionOptions(make=lambda: detector))
    (error,) = summary["errors"]
    assert "camera 'cam02': keypoints at" in error and "expected 33 numbers in u" in error and "are left out" in error
    assert sorted(number for camera, number, _ in detector.asked if camera == "cam02") == list(range(N_IMAGES))


@pytest.mark.long
def test_the_same_states_with_the_real_network(tmp_path: Path) -> None:
    weights_or_skip()
    sample_or_skip()
    folder, options = tmp_path / "balancing", ["--end", "12", "--shrink", "2", "--quiet"]
    assert main(["sample", "balancing", "--output", str(folder)]) == 0
    (tmp_path / "points.yaml").write_text("modalities: [region, keypoints]\n")
    files = ["--rig", "rig_refined.yaml", "--model", "person.yaml", "--initial-state", "initial_state.yaml"]
    given = [word if word.startswith("--") else str(folder / word) for word in files]
    given += ["--config", str(tmp_path / "points.yaml")]
    assert main(["track", *given, *options, "--output", str(tmp_path / "run")]) == 0
    bag = ["--from-run-bag", str(tmp_path / "run/bag")]
    assert main(["track", *given, *bag, "--quiet", "--output", str(tmp_path / "again")]) == 0
    assert (tmp_path / "again/states.csv").read_bytes() == (tmp_path / "run/states.csv").read_bytes()
    with BagReader(tmp_path / "run/bag") as reader:
        found = [len(message.persons) for name in reader.topics_of_type(KEYPOINTS) for _, message in reader.decoded(name)]
    assert len(found) == 4 * 12 and sum(n == 1 for n in found) >= 44
