#!/usr/bin/env python3
"""Two people tracked together: a real recording, and rendered people who cross, embrace and change places.

``multi.man_ratio``: mean joint error of the man in the recording of two, over that in the recording of him alone; the same body,
start, image sets and lag. ``multi.woman_iou``: overlap of the woman in her clothes with masks drawn by hand, over the pixels that
the man does not cover; the mean of the camera that is worst. ``multi.swaps``: image sets in which a body is nearer to the other
person than to its own. ``multi.set_ms_ratio``: time of an image set with both, over that of the man alone in the same images.
``multi.her_lenses.*``: the same through the lenses that the woman was rendered with, which are not those of the calibration.
``crossing.*``: rendered people with exact joints, by points and outlines from the true start, three held-out clips;
``crossing_contours.*``: by outlines alone. Lost limbs are those whose end is more than 150 mm off for some time; in swaps a
person is nearer to the other's true joints than to the own ones.

What the network finds is kept in the output folder.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark.clothed._people import KeptPeople
from benchmark.clothed._recording import ENDS
from benchmark.clothed._runs import joints_of
from benchmark.contour._balancing_clip import Clip as BalancingClip
from benchmark.contour._balancing_clip import Run, judge, load_clip
from benchmark.contour._runs import print_circumstances
from benchmark.contour.balancing import CONFIG, configured
from benchmark.contour.balancing import LAG_IMAGES as LAG_ALONE_IMAGES
from benchmark.multi._crossing_clip import DEFAULT_CACHE, PEOPLE, PHASES, Clip, make_clip
from benchmark.multi._real_clip import LAG_IMAGES, TwoPeople, load_two_people
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import TrackerError
from tracker_node.evaluation.metrics import intersection_over_union, lost_limbs
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.model.clothes import with_surfaces
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import ImageSet
from tracker_node.parallel import short_switches
from tracker_node.render.overlay import draw_overlay
from tracker_node.render.raycast.raycaster import render_view
from tracker_node.report.metrics_file import report_metrics
from tracker_node.tracking.config import KEYPOINTS, TrackerConfig
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.together.bodies import Bodies, shared_threads
from tracker_node.tracking.tracker import Tracker

WOMAN_AT_M = np.array([0.24, -0.37, 0.7])
LEAST_MASK_PX = 2000
SHOWN, SHOWN_CAMERAS = (22, 60, 96, 140), 4  # image sets and cameras of the picture
HELD_OUT = (101, 102, 103)  # seeds of clips whose people the tracker's tables have not seen


def main(arguments: list[str] | None = None) -> int:
    """Print the figures."""
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    try:
        people = KeptPeople(pose_weights(), args.output / "people.sqlite")
        config, outlines = (configured(CONFIG, [f"modalities={names}"]) for names in ("region,keypoints", "region"))
        figures: dict[str, float | int] = {}
        if args.only != "crossing":
            figures |= real(args.sample, args.output, config, people)
        if args.only != "real":
            clips = [make_clip(seed, DEFAULT_CACHE) for seed in (args.seeds or (HELD_OUT[:1] if args.quick else HELD_OUT))]
            figures |= crossing(clips, config, people, "crossing", args.picture)
            figures |= crossing(clips, outlines, people, "crossing_contours")
    except TrackerError as error:
        print(f"multi: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def real(sample: Path, output: Path, config: TrackerConfig, people: KeptPeople) -> dict[str, float | int]:
    """The recording of two people, and that of the man alone.

    Parameters
    ----------
    sample, output : folders of the clip of the man alone, and of what is kept.
    config, people : parameters; the network.

    Returns
    -------
    By key.
    """
    two, alone = load_two_people(sample.resolve(), output.resolve()), load_clip(sample, output)
    before, _ = followed(alone.rig, {"man": (alone.model, alone.start)}, config, alone.sets, people)
    off_alone = _error_mm(alone, before["man"], LAG_ALONE_IMAGES)
    figures: dict[str, float | int] = {"multi.man_alone_mpjpe_mm": off_alone}
    hers = replace(two, rig=two.woman_rig, full=two.woman_full)
    for prefix, clip in (("multi", two), ("multi.her_lenses", hers)):
        bodies = {"man": (clip.man, clip.man_start), "woman": (clip.woman, WOMAN_AT_M)}
        both, ms = followed(clip.rig, bodies, config, clip.sets, people)
        _, ms_of_one = followed(clip.rig, {"man": bodies["man"]}, config, clip.sets, people)
        off = _error_mm(replace(alone, rig=clip.rig, full=clip.full, sets=clip.sets), both["man"], LAG_IMAGES)
        ious = woman_ious(clip, both)
        print("woman: " + ", ".join(f"{camera} {iou:.3f}" for camera, iou in ious.items()), file=sys.stderr)
        for name, estimates in both.items():
            print(name, "".join(estimate.status.name[0] for estimate in estimates), file=sys.stderr)
        figures |= {
            f"{prefix}.man_mpjpe_mm": off,
            f"{prefix}.man_ratio": off / off_alone,
            f"{prefix}.woman_iou": min(ious.values()),
            f"{prefix}.woman_iou_mean": float(np.mean(list(ious.values()))),
            f"{prefix}.man_lost_sets": _lost(both["man"]),
            f"{prefix}.woman_lost_sets": _lost(both["woman"]),
            f"{prefix}.swaps": _swaps(both, before["man"]),
            f"{prefix}.set_ms_ratio": float(np.median(ms) / np.median(ms_of_one)),
        }
    return figures


def crossing(
    clips: Sequence[Clip], config: TrackerConfig, people: KeptPeople, prefix: str, picture: Path | None = None
) -> dict[str, float | int]:
    """Rendered people who cross, embrace and change places.

    Parameters
    ----------
    clips, config, people : recordings, parameters, the network.
    prefix : of the keys.
    picture : of both over the images of the first clip is written there; None: none.

    Returns
    -------
    By key, over all clips and people.
    """
    errors, swaps, limbs, lost = [], 0, 0, 0
    for clip in clips:
        bodies = {name: (clip.models[name], clip.starts[name]) for name in PEOPLE}
        found, _ = followed(clip.rig, bodies, config, clip.sets, people)
        if picture is not None:
            cv2.imwrite(str(picture), drawn(clip, found), [cv2.IMWRITE_JPEG_QUALITY, 85])
            picture = None
        for name, other in zip(PEOPLE, reversed(PEOPLE), strict=True):
            places = np.array([joints_of(clip.models[name], estimate)[0] for estimate in found[name]])
            off = np.linalg.norm(places - clip.truth[name], axis=2)
            is_lost = lost_limbs(off[:, list(ENDS)], np.ones((len(off), len(ENDS)), dtype=np.bool_))
            middles = [each.mean(axis=1) for each in (places, clip.truth[name], clip.truth[other])]
            swapped = np.linalg.norm(middles[0] - middles[1], axis=1) > np.linalg.norm(middles[0] - middles[2], axis=1)
            names = [clip.joints[end] for end, gone in zip(ENDS, is_lost, strict=True) if gone]
            said = "".join(estimate.status.name[0] for estimate in found[name])
            phases = ", ".join(f"{phase} {1e3 * off[first:end].mean():.0f}" for phase, (first, end) in PHASES.items())
            what = f"{1e3 * off.mean():.1f} mm ({phases}), lost {', '.join(names) or 'nothing'}"
            print(f"{prefix} {clip.folder.name} {name}: {what}\n{said}", file=sys.stderr)
            errors.append(1e3 * off.mean())
            swaps, limbs, lost = swaps + int(swapped.sum()), limbs + len(names), lost + _lost(found[name])
    return {
        f"{prefix}.swaps": swaps, f"{prefix}.lost_limbs": limbs, f"{prefix}.lost_sets": lost,
        f"{prefix}.mpjpe12_mm": float(np.mean(errors)),
    }  # fmt: skip


def drawn(clip: Clip, found: Mapping[str, Sequence[TrackEstimate]]) -> np.ndarray:
    """Both people in their clothes over the images of some cameras, an image set a row.

    Parameters
    ----------
    clip, found : the recording, and both in it.

    Returns
    -------
    BGR image.
    """
    rows = []
    for number in SHOWN:
        images = [clip.sets[number].images[i].pixels for i in range(SHOWN_CAMERAS)]
        for name in PEOPLE:
            estimate, model = found[name][number], clip.models[name]
            seen = Configuration(model if estimate.surfaces is None else with_surfaces(model, estimate.surfaces), estimate.state)
            images = [draw_overlay(image, seen, camera) for image, camera in zip(images, clip.rig, strict=False)]
        rows.append(np.hstack(images))
    return cv2.resize(np.vstack(rows), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


def followed(
    rig: CameraRig, bodies: Mapping[str, tuple], config: TrackerConfig, sets: Sequence[ImageSet], people: KeptPeople
) -> tuple[dict[str, list[TrackEstimate]], np.ndarray]:
    """Bodies tracked together.

    Parameters
    ----------
    rig, config, sets, people : cameras, parameters, images, network.
    bodies : by name, model, and the state at which it begins or a place near which it is looked for.

    Returns
    -------
    By body its estimates; milliseconds of each set, without the network.
    """
    at_once, threads = shared_threads(config.threads, len(bodies))
    config, trackers = replace(config, threads=threads), {}
    for name, (model, start) in bodies.items():
        trackers[name] = Tracker(rig, model, config, {}, start if isinstance(start, State) else None)
        if not isinstance(start, State):
            trackers[name].reinitialize(start)
    together, found, times = Bodies(trackers, at_once), {name: [] for name in bodies}, []
    for image_set in sets:
        seen = people.with_people(together, image_set)[0] if KEYPOINTS in config.modalities else image_set
        with short_switches():  # as in a run
            began = time.perf_counter()
            together.estimate(seen)
            together.learn()
            times.append(1e3 * (time.perf_counter() - began))
        for name, estimate in together.estimates.items():
            found[name].append(estimate)
    return found, np.array(times)


def woman_ious(clip: TwoPeople, estimates: Mapping[str, Sequence[TrackEstimate]]) -> dict[str, float]:
    """By camera, the mean overlap of the woman with her masks, where the man does not cover her.

    Parameters
    ----------
    clip, estimates : the clip, and both in it.
    """
    found = {}
    for camera in clip.full:
        values = []
        for number, mask in clip.woman_masks[camera.name].items():
            if mask.sum() < LEAST_MASK_PX:
                continue
            woman, man = (estimates[name][number] for name in ("woman", "man"))
            seen = clip.woman if woman.surfaces is None else with_surfaces(clip.woman, woman.surfaces)
            own = render_view(Configuration(seen, woman.state), camera)
            other = render_view(Configuration(clip.man, man.state), camera)
            values.append(intersection_over_union((own.labels > 0) & (own.depth < other.depth), mask))
        found[camera.name] = float(np.mean(values)) if woman.status.has_state else 0.0
    return found


def _error_mm(clip: BalancingClip, estimates: list[TrackEstimate], lag_images: float) -> float:
    result = judge(clip, Run(estimates, np.zeros(len(estimates))), "man", lag_images)
    print(f"man: {result.raw.mean_mm:.1f} mm, offset-free {result.offset_free.mean_mm:.1f}", file=sys.stderr)
    return float(result.raw.mean_mm)


def _lost(estimates: Sequence[TrackEstimate]) -> int:
    return sum(estimate.status in (Status.LOST, Status.INITIALIZING) for estimate in estimates)


def _swaps(both: Mapping[str, Sequence[TrackEstimate]], true_man: Sequence[TrackEstimate]) -> int:
    """Image sets in which the man's body is nearer to the woman's place than to his own, or the other way round."""
    swaps = 0
    for man, woman, true in zip(both["man"], both["woman"], true_man, strict=True):
        places = [each.state.T_world_root[:3, 3] for each in (man, woman, true)]
        wrong_man = np.linalg.norm(places[0] - places[2]) > np.linalg.norm(places[0] - WOMAN_AT_M)
        wrong_woman = woman.status.has_state and np.linalg.norm(places[1] - places[2]) < np.linalg.norm(places[1] - WOMAN_AT_M)
        swaps += bool(wrong_man or wrong_woman)
    return swaps


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(__doc__, "OMP_NUM_THREADS=1 python benchmark/multi/multi.py --json out/multi.json", "one rendered clip")
    add = parser.add_argument
    add("--only", choices=("real", "crossing"), help="only this recording")
    add("--seeds", nargs="+", type=int, metavar="N", help="of rendered clips")
    add("--picture", type=Path, metavar="FILE", help="write the first rendered clip with both people there (JPEG)")
    add("--sample", type=Path, default=Path("out/demo/sample"), metavar="FOLDER", help="of the clip (default: %(default)s)")
    add("--output", type=Path, default=Path("out/benchmark/multi"), metavar="FOLDER", help="of what is kept")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
