"""Tables of people: offsets of a detector's points and where surfaces are beside the shapes, from training clips; lengths.

    python -m benchmark.clothed._fit DRAWN/clip_1 ... DRAWN/clip_8

prints the rows of `tracker_node.model.humans.keypoints.BLAZEPOSE` and of `tracker_node.model.clothes`, means and
standard deviations over the clips and both sides, of a body of the default size; how a skeleton's bones are guessed
(`GUESSED_BONES`), and knees marked by the proportions of legs; and the spread of heat maps beside that of errors, which
`observation.keypoints.blazepose` is calibrated by. Clips that anything is judged on have no part in it.

    python -m benchmark.clothed._fit --lengths LENGTHS.csv

prints those of `tracker_node.model.shape_parameters`, of the people that ``person/_write_bodies.py --lengths`` has drawn.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from benchmark.clothed._people import KeptPeople
from benchmark.clothed._recording import ClothedClip, load_clip
from benchmark.clothed._runs import TOGETHER, settings
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE, GUESSED_BONES, leg_ratio, relative_size
from tracker_node.objective.lines.surfaces import N_UNKNOWNS, Surfaces
from tracker_node.observation.image_set import ImageSet
from tracker_node.tracking.keypoints.modality import DepthGuesses, points_of
from tracker_node.tracking.region.modality import RegionModality
from tracker_node.tracking.tracker import Tracker

_EVERY = 3  # image sets from one that is measured to the next
_ENDS = (
    ("left_shoulder", "left_elbow"), ("left_elbow", "left_wrist"), ("left_hip", "left_knee"), ("left_knee", "left_ankle"),
    ("shoulder", "hip"), ("left_shoulder", "right_shoulder"), ("left_hip", "right_hip"),
)  # fmt: skip
_LONG = [4, 2, 3]  # trunk, thigh and shank
_WIDE_M = 0.04  # prior of the unknowns of a surface while they are measured


def tracked(clip: ClothedClip, people: KeptPeople) -> Iterator[tuple[ImageSet, State, Tracker]]:
    """Every few image sets with people, the true state, and the tracker that has seen it."""
    tracker, state = Tracker(clip.rig, clip.model, settings(TOGETHER, ()), None, clip.start()), None
    for row, image_set in enumerate(clip.sets()):
        image_set, _ = people.with_people(tracker, image_set)
        tracker.step(image_set)
        state = fit_state_to_landmarks(clip.model, clip.targets[row], state).state
        if row % _EVERY == 0:
            yield image_set, state, tracker


class PointOffsetFit:
    """Offsets of the points of one clip, robust least squares over cameras and image sets."""

    def __init__(self, clip: ClothedClip):
        self.clip = clip
        self.names, self.body = points_of(clip.model, BLAZEPOSE)
        self._seen: list[list[tuple]] = [[] for _ in self.names]

    def add(self, image_set: ImageSet, state: State) -> None:
        """Take the first person of each camera, in crops of which there is one.

        Parameters
        ----------
        image_set : with people.
        state : the true one.
        """
        Ts = Configuration(self.clip.model, state).Ts_world_link
        for image in image_set.images:
            for person in (image.people or ())[:1]:
                size = max(person.box[2] - person.box[0], person.box[3] - person.box[1])
                for k, name in enumerate(self.names):
                    j = person.names.index(name)
                    spread = np.sqrt(0.5 * np.trace(person.covariances[j])) / size
                    seen = self.clip.rig[image.camera], Ts[self.body.links[k]], person.pixels[j], person.scores[j], size, spread
                    self._seen[k].append(seen)

    def fitted(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) offsets of a body of the default size, and (m, 3): errors (u, v) and stated spreads, in sizes of the person."""
        offsets, errors = np.zeros((len(self.names), 3)), []
        for k, seen in enumerate(self._seen):
            found = least_squares(lambda o, k=k: self._residuals(k, o).ravel() / 0.02, self.body.means[k], loss="soft_l1")
            offsets[k] = found.x
            residuals = self._residuals(k, found.x)
            errors += [(*residual, each[5]) for residual, each in zip(residuals, seen, strict=True) if each[3] > 0.5]
        return offsets / relative_size(self.clip.model), np.array(errors)

    def _residuals(self, k: int, offset: np.ndarray) -> np.ndarray:
        result = []
        for camera, T, pixel, score, size, _ in self._seen[k]:
            place = T[:3, :3] @ (self.body.positions[k] + offset) + T[:3, 3]
            result.append(score * (camera.project(place[None])[0][0] - pixel) / size)
        return np.array(result)


def guessed_and_true(image_set: ImageSet, state: State, points: PointOffsetFit) -> Iterator[np.ndarray]:
    """What skeletons tell in crops of which there is one.

    Parameters
    ----------
    image_set : with people.
    state : the true one.
    points : of the clip.

    Yields
    ------
    (n_bones + 1, 2): depths of the bones in lengths of them, and the distance in that which is true; guessed and true.
    """
    clip, places = points.clip, points.body.places(state)
    persons = [next(iter(image.people or ()), None) for image in image_set.images]
    found = DepthGuesses(clip.rig, points.names, points.body, settings(TOGETHER, ()).keypoints).of(persons)
    if found is not None:
        lengths = found.sigmas / [bone.sigma for bone in GUESSED_BONES]
        true = found.rays @ (found.bones @ places).T / lengths
        away = ((places.mean(axis=0) - found.centers) * found.rays).sum(axis=1)
        for i in np.flatnonzero(np.isfinite(found.distances)):
            guessed = np.append(found.depths[i] / lengths, found.distances[i] / away[i])
            yield np.column_stack([guessed, np.append(true[i], 1.0)])


def surfaces_at(state: State, tracker: Tracker, start: np.ndarray) -> np.ndarray:
    """Where the surfaces are in one image set.

    Parameters
    ----------
    state : the true one.
    tracker : has the colors and silhouettes of the set.
    start : (n_shapes, 4) meters, where they are taken to be at first.

    Returns
    -------
    (n_shapes, 4) meters.
    """
    region = tracker._track.engine.modalities[0]
    assert isinstance(region, RegionModality)
    prior = (_WIDE_M * relative_size(tracker.model)) ** 2 * np.tile(np.eye(N_UNKNOWNS), (len(tracker.model.shapes), 1, 1))
    for _ in range(2):
        lines = region._drawer.draw(region.views, state, 1.0, 2.0, None, Surfaces(start, prior))
        sums = lines.at(state).surfaces
        assert sums is not None
        start = start - (sums.covariances @ sums.b[:, :, None])[:, :, 0]
    return start


def both_sides(names: Sequence[str], values: np.ndarray, sideways: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Median and standard deviation over clips (the first axis) and sides, by the names of the left side."""
    mirror = np.ones(values.shape[2])
    mirror[sideways] = -1.0
    result = {}
    for i, name in enumerate(names):
        twin = name.replace("left_", "right_", 1)
        if not name.startswith("right_"):
            own = np.concatenate([values[:, i], mirror * values[:, list(names).index(twin)]])
            result[name.removeprefix("left_")] = np.median(own, axis=0), own.std(axis=0)
    return result


def proportions(lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of lengths of people over those of the default body of the same size, trunk and leg together: a line in the size.

    Parameters
    ----------
    lengths : (n_people, 7) meters: upper arm, forearm, thigh, shank, trunk, shoulders, hips.

    Returns
    -------
    Means and slopes (7,) of their logarithms by that of the size, and the covariance (7, 7) of what is left.
    """
    model = human_model()
    places = dict(zip(model.landmark_names, Configuration(model, State.neutral(model)).landmarks_world, strict=True))
    places |= {name: 0.5 * (places[f"left_{name}"] + places[f"right_{name}"]) for name in ("shoulder", "hip")}
    default = np.array([np.linalg.norm(places[one] - places[other]) for one, other in _ENDS])
    size = lengths[:, _LONG].sum(axis=1) / default[_LONG].sum()
    logarithms = np.log(lengths / default / size[:, None])
    by_size = np.column_stack([np.ones(len(size)), np.log(size)])
    (means, slopes), *_ = np.linalg.lstsq(by_size, logarithms, rcond=None)
    return means, slopes, np.cov((logarithms - by_size @ np.array([means, slopes])).T)


def print_proportions(path: Path) -> None:
    """Print the table of a file of lengths, as `tracker_node.model.shape_parameters` has it."""
    means, slopes, covariance = proportions(np.loadtxt(path, delimiter=",", skiprows=1))
    for name, values in (("_MEANS", means), ("_SLOPES", slopes)):
        print(f"{name} = np.array([{', '.join(f'{value:.3f}' for value in values)}])")
    print("_COVARIANCE = 1e-4 * np.array([")
    for row in 1e4 * covariance:
        print(f"    [{', '.join(f'{value:.2f}' for value in row)}],")
    print("])")


def main() -> None:
    """Print the tables of the clips named on the command line, or that of lengths."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], epilog="example: ... _fit out/clothed/clip_1")
    parser.add_argument("clips", nargs="*", type=Path, metavar="DIR", help="folders of training clips")
    parser.add_argument("--lengths", type=Path, metavar="FILE", help="of people, instead of clips")
    parser.add_argument("--model", metavar="MODEL", help="body to be scaled to the clips (default: the human with ankles)")
    parser.add_argument("--cache", type=Path, default=Path("out/clothed/people.sqlite"), help="what the network has found")
    args = parser.parse_args()
    if args.lengths:
        print_proportions(args.lengths)
        return
    if not args.clips:
        parser.error("expected folders of clips, or --lengths")
    people, offsets, errors, surfaces, guesses, ratios = KeptPeople(pose_weights(), args.cache), [], [], [], [], []
    for folder in args.clips:
        clip = load_clip(folder, load_model(args.model) if args.model else None)
        points, found = PointOffsetFit(clip), [np.zeros((len(clip.model.shapes), N_UNKNOWNS))]
        for image_set, state, tracker in tracked(clip, people):
            points.add(image_set, state)
            guesses += guessed_and_true(image_set, state, points)
            found.append(surfaces_at(state, tracker, np.median(found[1:] or found, axis=0)))
        own, own_errors = points.fitted()
        offsets.append(own)
        ratios.append(leg_ratio(clip.model))
        errors.append(own_errors)
        surfaces.append(np.median(found[1:], axis=0) / relative_size(clip.model))
        print(f"{folder.name}: {len(own_errors)} points", flush=True)
    for title, names, values, sideways in (
        ("points", points.names, np.array(offsets), 1),
        ("surfaces", [shape.name for shape in clip.model.shapes], np.array(surfaces), 2),
    ):
        print(f"\n{title}: medians, standard deviations, m")
        for name, (middle, spread) in both_sides(names, values, sideways).items():
            print(f"{name:12} {np.round(middle, 3)} {np.round(spread, 3)}")
    print("\nguessed skeletons: shares of the depth of a bone and standard deviations in its length; the same of the distance")
    names = [*(bone.far[0] for bone in GUESSED_BONES), "distance"]
    for name, (told, true) in zip(names, np.moveaxis(guesses, 0, 2), strict=True):
        share = float(told @ true / (true @ true))
        print(f"{name:15} {share:.2f} {np.std(told - share * true):.3f}")
    knees = np.mean([[own[points.names.index(f"{side}_knee"), 2] for own in offsets] for side in ("left", "right")], axis=0)
    by_leg, at_default = np.polyfit(ratios, knees, 1) if len(ratios) > 1 else (0.0, knees.mean())
    spread = np.std(knees - by_leg * np.array(ratios))
    print(f"\nknees along the leg: {at_default:.3f} + {by_leg:.3f} ratio of thigh and shank (logarithm), beside it {spread:.3f}")
    together = np.concatenate(errors)
    print("\nstated spread, robust spread of errors, both in thousandths of the person's size")
    for part in np.array_split(together[np.argsort(together[:, 2])], 8):
        print(f"{1e3 * np.median(part[:, 2]):6.1f} {1e3 * 1.4826 * np.median(np.abs(part[:, :2])):6.1f}")


if __name__ == "__main__":
    main()
