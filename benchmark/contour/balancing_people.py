#!/usr/bin/env python3
"""A real person by points and contours, without a static trial, a start or backgrounds: the Balancing clip, 100 image sets.

The body is made from the network's points in five image sets spread over the clip, the tracker finds it in the first set.
``balancing_people``: four cameras; errors against joints triangulated from 2D detections, good to 3 to 5 cm, with their constant
lag taken out; overlap of the body in its clothes with masks. ``balancing_people_2cams``: cameras 1 and 3.
``balancing_people_1cam``: each camera alone, which finds the body by itself; over all of them, limbs whose end joint is more than
150 mm off are wrong, and ``within_2_sigma`` is the fraction of the joints' errors within two standard deviations, axis by axis.

What the network finds is kept in the output folder.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark.clothed._judged import SIGMAS
from benchmark.clothed._people import KeptPeople
from benchmark.clothed._runs import limbs_of
from benchmark.contour._balancing_clip import Clip, Run, judge, load_clip, silhouettes
from benchmark.contour._runs import print_circumstances
from benchmark.contour.balancing import CONFIG, LAG_IMAGES, TWO_CAMERAS, configured
from tracker_node.errors import TrackerError
from tracker_node.evaluation.evaluate import Evaluation
from tracker_node.evaluation.metrics import LOST_LIMB_M
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.model.clothes import with_surfaces
from tracker_node.model.humans.human import human_model
from tracker_node.report.metrics_file import report_metrics
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import LimbStatus
from tracker_node.tracking.keypoints.body_from_points import body_from_points
from tracker_node.tracking.tracker import Tracker

BODY_SETS = 5
ENDS = ("left_wrist", "right_wrist", "left_ankle", "right_ankle")  # of the limbs as `limbs_of` has them
SHORT = ("mpjpe_mm", "mpjpe_offset_free_mm", "lost_sets", "lost_limbs")


def main(arguments: list[str] | None = None) -> int:
    """Print the figures."""
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    try:
        clip = load_clip(args.sample, args.output)
        config = configured(CONFIG, ["modalities=region,keypoints"])
        people = KeptPeople(pose_weights(), args.output / "people.sqlite")
        figures = measure(with_own_body(clip, people), config, people)
    except TrackerError as error:
        print(f"balancing: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def with_own_body(clip: Clip, people: KeptPeople) -> Clip:
    """The clip with the body that its images show."""
    seen = [
        [people.find(np.ascontiguousarray(image.bgr), None).people for image in clip.sets[row].images]
        for row in range(0, len(clip.sets), len(clip.sets) // BODY_SETS)
    ]
    return replace(clip, model=body_from_points(human_model(ankles=True), clip.rig, seen).model)


def measure(clip: Clip, config: TrackerConfig, people: KeptPeople) -> dict[str, float | int]:
    """All runs; a line is printed for each."""
    run, first = tracked(clip, config, people)
    result = _judged(clip, run, "balancing_people", None)
    figures = {f"balancing_people.{key}": result.metrics()[f"balancing_people.{key}"] for key in (*SHORT, "lag_images")}
    surfaces = run.estimates[-1].surfaces
    assert surfaces is not None
    seen = replace(clip, model=with_surfaces(clip.model, surfaces))
    ious = {camera: float(np.mean(values)) for camera, values in silhouettes(seen, run).ious.items() if values}
    figures |= {"balancing_people.first_state_set": first, "balancing_people.iou_min": min(ious.values())}
    figures |= {f"balancing_people.iou_{camera}": value for camera, value in ious.items()}
    two = clip.with_cameras(TWO_CAMERAS)
    run_of_two, first = tracked(two, config, people)
    result = _judged(two, run_of_two, "balancing_people_2cams", LAG_IMAGES)
    figures |= {f"balancing_people_2cams.{key}": result.metrics()[f"balancing_people_2cams.{key}"] for key in SHORT}
    figures["balancing_people_2cams.first_state_set"] = first
    alone = Alone()
    for camera in clip.rig.names:
        one = clip.with_cameras((camera,))
        run_of_one, first = tracked(one, config, people)
        alone.first = max(alone.first, first)
        alone.add(one, run_of_one, _judged(one, run_of_one, f"balancing_people_1cam, {camera}", LAG_IMAGES))
    return figures | alone.figures()


def tracked(clip: Clip, config: TrackerConfig, people: KeptPeople) -> tuple[Run, int]:
    """Estimates that have a state, and how many image sets came before them."""
    tracker, estimates = Tracker(clip.rig, clip.model, config, {}), []
    for image_set in clip.sets:
        estimates.append(tracker.step(people.with_people(tracker, image_set)[0]))
    known = [estimate for estimate in estimates if estimate.status.has_state]
    if not known:
        raise TrackerError(f"no start was found: {estimates[-1].status_reason}")
    return Run(known, np.zeros(len(known))), len(estimates) - len(known)


def _judged(clip: Clip, run: Run, name: str, lag_images: float | None) -> Evaluation:
    result = judge(clip, run, name.partition(",")[0], lag_images)
    of_joints = ", ".join(f"{j} {e:.0f}" for j, e in zip(result.joints, result.offset_free.per_joint_mm(), strict=True))
    print(
        f"{name}: {result.raw.mean_mm:.1f} mm, offset-free {result.offset_free.mean_mm:.1f} ({of_joints})",
        file=sys.stderr, flush=True,
    )  # fmt: skip
    return result


@dataclass(eq=False)
class Alone:
    """Limb-sets and joints of cameras alone, counted; ``first``: the latest image set in which one has found the body."""

    first: int = 0
    wrong: int = 0
    wrong_tracking: int = 0
    within: int = 0
    axes: int = 0

    def add(self, clip: Clip, run: Run, result: Evaluation) -> None:
        """One camera's run.

        Parameters
        ----------
        clip, run, result : what was tracked, how, and its errors.
        """
        errors, valid = result.raw.errors_m, result.raw.valid
        columns = [result.joints.index(end) for end in ENDS]
        for row, estimate in enumerate(run.estimates):
            wrong = valid[row, columns] & (errors[row, columns] > LOST_LIMB_M)
            self.wrong += int(wrong.sum())
            self.wrong_tracking += int((wrong & (np.array(limbs_of(estimate)) == LimbStatus.TRACKING)).sum())
            rows = [clip.model.landmark_index(name) for name in result.joints]
            sigmas = np.sqrt(np.einsum("nii->ni", estimate.landmark_covariances(clip.model)[rows]))
            off = np.abs(result.corrected_m[row] - result.truth_m[row])[valid[row]]
            self.within += int((off <= SIGMAS * sigmas[valid[row]]).sum())
            self.axes += off.size

    def figures(self) -> dict[str, float | int]:
        """By key."""
        return {
            "balancing_people_1cam.wrong_called_tracking": self.wrong_tracking / max(self.wrong, 1),
            "balancing_people_1cam.wrong_limb_sets": self.wrong,
            "balancing_people_1cam.first_state_set": self.first,
            "balancing_people_1cam.within_2_sigma": self.within / max(self.axes, 1),
        }


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__,
        "OMP_NUM_THREADS=1 python benchmark/contour/balancing_people.py --json out/balancing_people.json",
        "the same: it takes two minutes",
    )
    add = parser.add_argument
    add("--sample", type=Path, default=Path("out/demo/sample"), metavar="FOLDER", help="of the clip (default: %(default)s)")
    add("--output", type=Path, default=Path("out/benchmark/balancing"), metavar="FOLDER", help="of what is kept")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
