#!/usr/bin/env python3
"""People who come into a room and leave it, followed without being named: rendered, clothed, by the network's points and lines.

The clips are those of `multi.py` (two people who pass each other closely, embrace and part), with nobody in the room at first.
One person is there from image set 10 on, the other from 36 (they have passed) to 135 (they have parted), both out of nothing, as
if through a door.

``joining.bodies``: bodies that were begun, of two people a clip. ``joining.found_s``: longest time from being there until being
TRACKING. ``joining.gone_s``: longest time from being away until being LOST. ``joining.swaps``: image sets in which a body is
nearer to the other person. ``joining.lost_limbs``, ``joining.mpjpe12_mm``: as in ``crossing.*``, of bodies whose lengths were
found from one image set. ``joining.missed_sets``: image sets of a person who is there, a second after coming, without a state.

``joining.real_bodies``: bodies begun in the real recording of two people of `multi.py`. ``joining.real_found``: those of the two
who are where man and woman are, in nine of ten image sets that come half a second after the first.

``tracker_node track`` does the same with ``joining:`` in recording.yaml; the run folders are kept beside the clip.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.clothed._recording import ENDS, JOINTS
from benchmark.contour._runs import print_circumstances
from benchmark.multi._crossing_clip import DEFAULT_BODIES, DEFAULT_CACHE, code_of_clips
from benchmark.multi._real_clip import load_two_people
from benchmark.multi.crossing._motion import N_SETS
from benchmark.multi.crossing._stage import PEOPLE, set_stage, write_recording
from benchmark.multi.crossing._walker import RATE_HZ
from benchmark.multi.multi import WOMAN_AT_M
from tracker_node.api.functions import track_bodies
from tracker_node.api.run import load_run
from tracker_node.calibration.body import targets_of
from tracker_node.errors import TrackerError
from tracker_node.evaluation.metrics import lost_limbs
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.people.detection import AROUND_S, DetectionOptions, PeopleDetection
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.together.bodies import Bodies
from tracker_node.tracking.together.joining import USUAL, Joining, JoiningOptions
from tracker_node.tracking.tracker import Tracker

HELD_OUT = (101, 102, 103)
SEEN = {PEOPLE[0]: range(10, N_SETS), PEOPLE[1]: range(36, 135)}
_RECORDING = """\
rig: rig.yaml
joining: {{model: {model}}}
sources: "{{name}}/%04d.jpg"
images: {{rate_hz: {rate}}}
output: runs
"""
_NEAR_M = 0.5  # of a person's middle: the body is that person


def main(arguments: list[str] | None = None) -> int:
    """Print the figures."""
    args = _arguments(arguments)
    try:
        figures = {} if args.seeds else real(args.sample.resolve(), args.output.resolve())
        if not args.only_real:
            figures |= judged([visited(seed, args.cache, args.bodies) for seed in args.seeds or HELD_OUT])
    except TrackerError as error:
        print(f"joining: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def real(sample: Path, output: Path) -> dict[str, float | int]:
    """The real recording of two people, none of whom is named.

    Parameters
    ----------
    sample, output : see `multi.real`.

    Returns
    -------
    By key.
    """
    clip = load_two_people(sample, output)
    options = JoiningOptions(human_model(), USUAL)
    joining = Joining(clip.rig, options, lambda model, state: Tracker(clip.rig, model, options.config, {}, state))
    bodies, detection = Bodies({}, joining=joining), PeopleDetection(clip.rig, USUAL, DetectionOptions(around_s=AROUND_S))
    known: dict[str, list[np.ndarray]] = {}
    for image_set in clip.sets:
        bodies.estimate(detection.with_people(bodies, image_set))
        bodies.learn()
        for name, estimate in bodies.estimates.items():
            known.setdefault(name, []).extend([estimate.state.T_world_root[:2, 3]] * estimate.status.known)
    for name, places in known.items():
        print(f"{name}: known in {len(places)} image sets, at {np.mean(places, axis=0).round(2)} m", file=sys.stderr)
    ends = np.array([clip.man_start.T_world_root[:2, 3], WOMAN_AT_M[:2]])
    begun = [places[0] for places in known.values() if len(places) >= 0.9 * (len(clip.sets) - RATE_HZ)]
    at = {int(np.argmin(np.linalg.norm(ends - place, axis=1))) for place in begun}
    return {"joining.real_bodies": len(known), "joining.real_found": len(at)}


def visited(seed: int, cache: Path, bodies: Path) -> Path:
    """Folder of the clip of a seed, with the runs of all who have joined in ``runs``, made now.

    Parameters
    ----------
    seed : of the clip.
    cache, bodies : folders of clips, and of people to draw.
    """
    folder, code = cache / f"joining_{seed}", code_of_clips(str(SEEN))
    kept = folder / "clip.json"
    if not kept.is_file() or json.loads(kept.read_text(encoding="utf-8"))["code"] != code:
        print(f"{folder}: drawing {N_SETS} image sets", file=sys.stderr, flush=True)
        write_recording(set_stage(seed, bodies), folder, code, SEEN)
    shutil.rmtree(folder / "runs", ignore_errors=True)
    model = Path(__file__).resolve().parents[2] / "config/models/human.yaml"
    text = _RECORDING.format(model=model, rate=RATE_HZ)
    (folder / "recording.yaml").write_text(text, encoding="utf-8")
    track_bodies(folder / "recording.yaml", folder / "runs")
    return folder


def judged(folders: list[Path]) -> dict[str, float | int]:
    """Figures of clips that have been tracked, over all people.

    Parameters
    ----------
    folders : of `visited`.

    Returns
    -------
    By key.
    """
    found, gone, errors = [], [], []
    counts = dict.fromkeys(("bodies", "swaps", "lost_limbs", "missed_sets"), 0)
    for folder in folders:
        truth = {name: _truth(folder, name) for name in PEOPLE}
        middles = {name: places.mean(axis=1) for name, places in truth.items()}
        runs = sorted((folder / "runs").iterdir())
        counts["bodies"] += len(runs)
        states = {path.name: _states(path) for path in runs}
        for person, other in zip(PEOPLE, reversed(PEOPLE), strict=True):
            rows = SEEN[person]
            of = {body: np.sum([_is_at(states[body], i, middles[person]) for i in rows]) for body in states}
            body = max(of, key=lambda name: of[name], default=None)
            own = {} if body is None else states[body]
            known = [i for i in rows if i in own and own[i][0].has_state]
            tracking = [i for i in known if own[i][0] is Status.TRACKING]
            found.append((tracking[0] - rows[0]) / RATE_HZ if tracking else np.inf)
            counts["missed_sets"] += sum(i not in known for i in rows if i >= rows[0] + RATE_HZ)
            after = [i for i in range(rows[-1] + 1, N_SETS) if i in own and own[i][0] is not Status.LOST]
            if rows[-1] + 1 < N_SETS:
                gone.append(len(after) / RATE_HZ)
            off = np.array([np.linalg.norm(own[i][1] - truth[person][i], axis=1) for i in known])
            for i in known:
                middle, away = own[i][1].mean(axis=0), [middles[each][i] for each in (person, other)]
                counts["swaps"] += int(np.linalg.norm(middle - away[0]) > np.linalg.norm(middle - away[1]) and i in SEEN[other])
            limbs = lost_limbs(off[:, list(ENDS)], np.ones((len(off), len(ENDS)), dtype=np.bool_))
            counts["lost_limbs"] += int(np.sum(limbs))
            errors.append(1e3 * off.mean())
            said = "".join(own[i][0].name[0] if i in own else "." for i in range(N_SETS))
            lost = ", ".join(JOINTS[end] for end, is_lost in zip(ENDS, limbs, strict=True) if is_lost)
            print(f"{folder.name} {person} is {body}: {errors[-1]:.1f} mm, lost {lost or 'nothing'}\n{said}", file=sys.stderr)
    return {
        "joining.people": len(PEOPLE) * len(folders), **{f"joining.{name}": n for name, n in counts.items()},
        "joining.found_s": float(max(found)), "joining.gone_s": float(max(gone)), "joining.mpjpe12_mm": float(np.mean(errors)),
    }  # fmt: skip


def _truth(folder: Path, name: str) -> np.ndarray:
    model, markers = human_model(), load_trc(folder / name / "truth.trc")
    return np.array([[targets_of(model, markers, row)[joint] for joint in JOINTS] for row in range(len(markers))])


def _states(path: Path) -> dict[int, tuple[Status, np.ndarray]]:
    """By image set, status and places (n_joints, 3) of a body."""
    run, rows = load_run(path), {}
    joints = [run.model.landmark_index(name) for name in JOINTS]
    for stamp_ns, status, values in zip(run.data.stamps_ns, run.data.status, run.data.values, strict=True):
        places = Configuration(run.model, State.from_values(values)).landmarks_world[joints]
        rows[round(stamp_ns * 1e-9 * RATE_HZ)] = Status(status), places
    return rows


def _is_at(states: dict[int, tuple[Status, np.ndarray]], i: int, middles: np.ndarray) -> bool:
    return i in states and bool(np.linalg.norm(states[i][1].mean(axis=0) - middles[i]) < _NEAR_M)


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, epilog="example:\n  OMP_NUM_THREADS=1 python benchmark/multi/joining.py --seeds 1 2 3",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    add = parser.add_argument
    add("--seeds", nargs="+", type=int, metavar="N", help="of rendered clips (default: held-out ones, 101 to 103)")
    add("--cache", type=Path, default=DEFAULT_CACHE, metavar="FOLDER", help="of clips (default: %(default)s)")
    add("--bodies", type=Path, default=DEFAULT_BODIES, metavar="FOLDER", help="of people to draw (default: %(default)s)")
    add("--only-real", action="store_true", help="only the real recording")
    add("--sample", type=Path, default=Path("out/demo/sample"), metavar="FOLDER", help="of the real clip (default: %(default)s)")
    add("--output", type=Path, default=Path("out/benchmark/multi"), metavar="FOLDER", help="of what is kept of it")
    add("--json", type=Path, metavar="FILE", help="write the figures there")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
