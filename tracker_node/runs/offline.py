"""The tracker on recorded images: no ROS, no clock, the same states whenever and wherever it runs."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..camera.rig import CameraRig
from ..compiled.ahead import compile_ahead, show_progress
from ..errors import TrackerError, without_password
from ..loaders.bag.message_types import KEYPOINTS as KEYPOINTS_MESSAGE
from ..loaders.bag.reader import BagReader
from ..loaders.images.source import SourceOptions, assumed_rate, load_backgrounds, resized_backgrounds
from ..loaders.source_address import relocated
from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..model.humans.keypoints import KeypointTable
from ..observation.image_set import ImageSet
from ..parallel import short_switches
from ..tracking.config import KEYPOINTS, REGION, TrackerConfig
from ..tracking.estimate import Status, TrackEstimate
from ..tracking.keypoints.body_from_points import NEAR_M, place_text
from ..tracking.together.bodies import Bodies, shared_threads
from ..tracking.together.joining import Joining, JoiningOptions
from ..tracking.tracker import Tracker
from ..tracking.uncertainty.covariance import unobservable
from .config_file import config_for
from .image_sets import BagStream, ImageSetStream, SourceStream, resampled_rig, rig_of_bag
from .images import JOINED_AFTER, run_stream
from .joint_states import JointStateFile, JointStatesBeside, check_use, load_joint_states
from .load import run_info
from .loop import TrackingLoop
from .people.detection import AROUND_S, DetectionOptions, PeopleDetection
from .people.recorded import PointFiles, RecordedPeople, open_recorded_people
from .recorded_sets import RecordedRunStream
from .writer import MODEL, RunWriter, SmoothedWriter, asked_of_run, check_free, counted_sets, write_joined

Progress = Callable[[int, int | None, TrackEstimate], None]


@dataclass(frozen=True, eq=False)
class Recording:
    """What `track` needs.

    Parameters
    ----------
    rig : cameras with their lenses, places and sources (videos, image folders, bags).
    model : body to track.
    config : parameters of the tracker; left out: those of `config_for`, by which people are compared by points, too.
    initial_state : where the body is in the first images; None: it is searched for in them.
    occluders : fixed things that may hide the body, in world axes.
    images : which images of the sources, at which rate and size.
    detection : how people are found in the images, where `keypoints` is among the modalities.
    points : files with the points of another detector, in whose place; None: none.
    person : (3,) meters, world: of several people, the one there; None: the one nearest to where the cameras look.
    joint_states : what a robot says of its joints; None: nothing.
    masks : record the body's silhouette in every camera, too.
    masked_images : record the images where the body is, the rest black, too.
    output : folder that ``recording.yaml`` names; None: none.
    files : name -> path of the files that the recording was read from, for ``run.json``.

    Examples
    --------
    >>> rig, model = load_rig("rig.yaml"), load_model("person.yaml")  # doctest: +SKIP
    >>> recording = Recording(rig, model, initial_state=load_state("start.yaml", model))  # doctest: +SKIP
    """

    rig: CameraRig
    model: ArticulatedModel
    config: TrackerConfig = None  # type: ignore[assignment]
    initial_state: State | None = None
    occluders: ArticulatedModel | None = None
    images: SourceOptions = field(default_factory=SourceOptions)
    detection: DetectionOptions = field(default_factory=DetectionOptions)
    points: PointFiles | None = None
    person: np.ndarray | None = None
    joint_states: JointStateFile | None = None
    masks: bool = False
    masked_images: bool = False
    output: Path | None = None
    files: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value, kind in (("rig", self.rig, CameraRig), ("model", self.model, ArticulatedModel)):
            if not isinstance(value, kind):
                raise TypeError(f"{name}: expected a {kind.__name__} (load_{name} reads one), got {value!r}")
        if not isinstance(self.initial_state, State | None):
            raise TypeError(f"initial_state: expected a State (load_state(path, model) reads one), got {self.initial_state!r}")
        if self.person is not None:
            object.__setattr__(self, "person", _place(self.person))
        if self.config is None:
            object.__setattr__(self, "config", config_for(None, self.model, self.points is not None))

    def __repr__(self) -> str:
        """Two lines: body and cameras, by what they are compared and where the body begins."""
        begins = "from a given state" if self.initial_state is not None else "which is searched for"
        begins = begins if self.person is None else f"{begins} at {self.person.tolist()}"
        return f"<{type(self).__name__} of {self.model!r} {begins}\n by {', '.join(self.config.modalities)} in {self.rig!r}>"

    def image_sets(self) -> ImageSetStream:
        """The image sets of the sources, in the order of their stamps; iterate over them once.

        Raises
        ------
        SourceError : not a single source can be opened.
        """
        return SourceStream(self.rig, self.config.synchronizer, self.images)

    def named_options(self) -> dict[str, Any]:
        """Content of ``options`` in ``run.json``, by the names that the command line uses."""
        size = self.images.size
        return {
            **dict(self.files),
            "cameras": list(self.rig.names),
            "source": [[camera.name, _from_anywhere(camera.source)] for camera in self.rig if camera.source],
            "start": self.images.start,
            "end": self.images.end,
            "rate": self.images.rate_hz,
            "resize": None if size is None else list(size),
            "shrink": self.images.shrink,
            "base_stamp_ns": self.images.base_stamp_ns,
            "keypoints_weights": None if self.detection.weights is None else str(self.detection.weights),
            "keypoints_every": self.detection.every_sets,
            "keypoints": None if self.points is None else str(self.points.path.resolve()),
            "keypoints_table": None if self.points is None or self.points.table is None else str(self.points.table.resolve()),
            "keypoints_first": 0 if self.points is None else self.points.first,
            "person": None if self.person is None else list(map(float, self.person)),
            "joint_states": None if self.joint_states is None else str(self.joint_states.path.resolve()),
            "joint_states_topic": None if self.joint_states is None else self.joint_states.topic,
            "masks": self.masks,
            "masked_images": self.masked_images,
        }


def _place(person: Any) -> np.ndarray:
    """(3,) meters, of what a program has given."""
    try:
        place = np.asarray(person, dtype=np.float64)
    except (TypeError, ValueError):
        place = np.empty(0)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise TypeError(f"person: expected three numbers, the place in meters in world axes, got {person!r}")
    return place


def _from_anywhere(source: str) -> str:
    return without_password(relocated(source, Path.cwd()))


@dataclass(frozen=True, eq=False, repr=False)
class OfflineRun(Recording):
    """A recording, and what is asked of the run.

    Parameters
    ----------
    bag : take the images from this bag instead of the rig's sources.
    from_run : use exactly the image sets that the states in ``bag`` were made from; their images come from the bag, or from
        the rig's sources if the bag holds none.
    max_sets : stop after so many sets.
    smooth_s : smooth the states with so many seconds of what came after them; infinite: with all of it; None: not at all.
    table : what the points in a bag are on the body; None: those of BlazePose.
    asked : what the user gave, for ``run.json``.
    """

    bag: Path | None = None
    from_run: bool = False
    max_sets: int | None = None
    smooth_s: float | None = None
    table: KeypointTable | None = None
    asked: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class JoiningRun:
    """People who may join a run.

    Parameters
    ----------
    options : who may, and when somebody has left.
    run : of a body that joins, as if it were alone; its model is that of ``options``.
    output : folder; the run of who joins goes into a folder of its name there.
    """

    options: JoiningOptions
    run: OfflineRun
    output: Path


def run_together(
    runs: Mapping[str, OfflineRun], outputs: Mapping[str, Path], progress: Progress | None = None,
    tell: Callable[[str], None] = lambda sentence: None, joining: JoiningRun | None = None,
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Track one body, or several in the same images, each of which knows of the others, and write the folders of the runs.

    An error in the middle (a damaged file, images of a wrong size) ends the run, but what was tracked until then is in the
    folders, and ``errors`` of the summary names it.

    Parameters
    ----------
    runs : by the name of the body; rig, images, points, detection and joint states are those of the first.
    outputs : by the name of the body, the folder of its run, made here.
    progress : called after each set with its number, how many are expected, and the estimate of whichever body is worst off.
    tell : called with a sentence for all that is wrong with the sources, or unusual, before anything is tracked.
    joining : people who come and go beside these, who may be none; None: nobody does.

    Returns
    -------
    By the name of the body, also of who has joined, content of its ``run.json``.

    Raises
    ------
    TrackerError : nothing can be tracked at all.
    """
    everybody = [*runs.values(), *([] if joining is None else [joining.run])]
    run = everybody[0]
    _check_together(runs, joining)
    using = next((each for each in everybody if KEYPOINTS in each.config.modalities), run)
    if joining is not None:
        using = replace(using, detection=replace(using.detection, around_s=AROUND_S))
    with ExitStack() as stack:
        stack.enter_context(short_switches())
        reader = stack.enter_context(BagReader(run.bag)) if run.bag else None
        rig, stream = _stream_of(run, reader, KEYPOINTS in using.config.modalities)
        recorded = _recorded_of(using, rig, stream)
        for sentence in (*stream.errors, *stream.notes):
            tell(sentence)
        backgrounds = resized_backgrounds(load_backgrounds(run.rig), rig)
        table = run.table if recorded is None else recorded.table
        detection = _detection_of(using, rig, reader) if recorded is None else recorded
        at_once, threads = shared_threads(run.config.threads, len(everybody) + (joining is not None))
        followers = _Followers(rig, backgrounds, table, detection, threads, stack, joining)
        for name, each in runs.items():
            followers.add(name, each, outputs[name])
        joint_states = _joint_states_of(run)

        def prepared(tracker: Any, image_set: ImageSet) -> ImageSet:
            image_set = image_set if joint_states is None else joint_states.with_joint_states(image_set)
            return image_set if detection is None else detection.with_people(tracker, image_set)

        if any(REGION in each.config.modalities for each in everybody):
            compile_ahead(show_progress)
        trackers = {name: body.tracker for name, body in followers.bodies.items()}
        bodies = Bodies(trackers, at_once, followers.joining(rig))
        loop = TrackingLoop(bodies, prepared)
        try:
            _track(run, loop, stream, followers, progress)
        except TrackerError as error:
            stream.errors.append(str(error))
        except KeyboardInterrupt:
            stream.errors.append("ended by Ctrl-C before the last image set")
            raise
        except OSError as error:
            stream.errors.append(f"ended before the last image set: {error.strerror or error}")
            raise
        finally:
            if joint_states is not None and (note := joint_states.note):
                tell(note)
                (stream.errors if joint_states.unused else stream.notes).append(note)
            if isinstance(stream, RecordedRunStream) and stream.difference:
                tell(stream.difference)
                stream.notes.append(stream.difference)
            if bodies.turned_away:
                tell(bodies.turned_away)
                stream.notes.append(bodies.turned_away)
            names = list(followers.bodies)
            summaries = {name: body.ended(stream, detection, names) for name, body in followers.bodies.items()}
        if not summaries:  # nobody has come
            for sentence in stream.errors:
                tell(sentence)
    return summaries


def _check_together(runs: Mapping[str, OfflineRun], joining: JoiningRun | None) -> None:
    """What several bodies have in common, and what only one that is alone can have."""
    if joining is not None:
        taken = [name for name in joining.options.names if name in runs]
        if taken:
            raise TrackerError(f"joining: expected names that no body has, got {', '.join(taken)}")
        runs = {**runs, "those who join": joining.run}
    first = next(iter(runs))
    for name, run in runs.items():
        if run.config.synchronizer != runs[first].config.synchronizer:
            raise TrackerError(f"bodies: expected the same synchronizer.* for all, got others for {name} than for {first}")
        if run.joint_states is not None and len(runs) > 1:
            raise TrackerError(f"bodies: expected no joint states beside several bodies, got some for {name}")


class _Followed:
    """One body of a run: its tracker, and what is written of it."""

    def __init__(
        self, run: OfflineRun, tracker: Tracker, rig: CameraRig, output: Path, detector: str | None, stack: ExitStack,
        joined_after: int | None = None,
    ):  # fmt: skip
        self._run, self.tracker = run, tracker
        if run.smooth_s is not None and not tracker.in_information_units:
            raise TrackerError(f"to smooth takes contours (region, chamfer), got the modality {run.config.colors} alone")
        self._writer = stack.enter_context(
            RunWriter(output, rig, run.model, masks=run.masks, masked_images=run.masked_images, detector=detector)
        )
        self._smoothed: SmoothedWriter | None = None
        if run.smooth_s is not None:
            self._smoothed = stack.enter_context(SmoothedWriter(output, run.model, run.config.motion, run.smooth_s))
        self._record, self._joined_after = _Record(run.model, run.person), joined_after

    def take(self, estimate: TrackEstimate, image_set: ImageSet) -> None:
        """Write what has been made of an image set."""
        self._writer.append(estimate, image_set)
        if self._smoothed is not None:
            self._smoothed.append(estimate)
        self._record.add(estimate)

    def ended(
        self, stream: ImageSetStream, detection: PeopleDetection | RecordedPeople | None, bodies: Sequence[str]
    ) -> dict[str, Any]:
        """Write and return the summary."""
        summary = _summary(self._run, stream, self._record, detection)
        if doubt := self.tracker.doubt_of_size:
            summary["notes"].append(doubt)
        if len(bodies) > 1:
            summary["bodies"] = list(bodies)
        if self._joined_after is not None:  # and there was no more of it than is here
            summary |= {JOINED_AFTER: self._joined_after, "expected_image_sets": summary["image_sets"]}
        self._writer.write_summary(summary)
        return summary


class _Followers:
    """All bodies of a run, also those of people who join."""

    def __init__(
        self, rig: CameraRig, backgrounds: Mapping, table: KeypointTable | None,
        detection: PeopleDetection | RecordedPeople | None, threads: int, stack: ExitStack, joining: JoiningRun | None,
    ):  # fmt: skip
        self._rig, self._backgrounds, self._table, self._detection = rig, backgrounds, table, detection
        self._threads, self._stack, self._joining = threads, stack, joining
        self.bodies: dict[str, _Followed] = {}
        self._sets = 0

    def tracker(self, run: OfflineRun, model: ArticulatedModel, state: State | None) -> Tracker:
        config = replace(run.config, threads=self._threads)
        return Tracker(self._rig, model, config, self._backgrounds, state, run.occluders, self._table)

    def add(self, name: str, run: OfflineRun, output: Path) -> None:
        """A body that is known by name."""
        tracker = self.tracker(run, run.model, run.initial_state)
        if run.person is not None:
            if run.initial_state is not None:
                raise TrackerError("expected a place to search a person at (--person) or an initial state, got both")
            tracker.reinitialize(run.person)
        self._begin(name, run, tracker, output)

    def _begin(self, name: str, run: OfflineRun, tracker: Tracker, output: Path, joined_after: int | None = None) -> None:
        detector = _detector_name(run, self._detection)
        self.bodies[name] = _Followed(run, tracker, self._rig, output, detector, self._stack, joined_after)

    def joining(self, rig: CameraRig) -> Joining | None:
        """Those who may join."""
        if self._joining is None:
            return None
        run = replace(self._joining.run, config=self._joining.options.config)
        for name in self._joining.options.names:
            check_free(self._joining.output / name)
        return Joining(rig, self._joining.options, lambda model, state: self.tracker(run, model, state), self._table)

    def take(self, together: Bodies, image_set: ImageSet) -> None:
        """Write what has been made of an image set, of everybody who is there."""
        for name, estimate in together.estimates.items():
            if name not in self.bodies:
                assert self._joining is not None
                tracker = together.trackers[name]
                output = self._joining.output / name
                asked = {**self._joining.run.asked, "model": str((output / MODEL).resolve())}
                self._begin(name, replace(self._joining.run, model=tracker.model, asked=asked), tracker, output, self._sets)
                write_joined(output, tracker.model, name)
            self.bodies[name].take(estimate, image_set)
        self._sets += 1


def _stream_of(run: OfflineRun, reader: BagReader | None, with_points: bool) -> tuple[CameraRig, ImageSetStream]:
    """The rig for the images, and the image sets, of a bag with the points that it holds."""
    if reader is None:
        stream = SourceStream(run.rig, run.config.synchronizer, run.images, str(run.asked.get("rig") or "rig"))
        stream.notes += assumed_rate(stream.sources.values(), "--rate, or rate_hz below images in recording.yaml,")
        return resampled_rig(run.rig, run.images), stream
    if run.from_run:
        return run_stream(run.rig, reader, run_info(reader.path), run.images)
    rig = rig_of_bag(run.rig, reader)
    return rig, BagStream(rig, run.config.synchronizer, reader, with_points=with_points)


def _joint_states_of(run: OfflineRun) -> JointStatesBeside | None:
    """What a robot says; None where nothing is used."""
    if run.joint_states is None:
        return None
    check_use(run.model, run.config)
    if run.smooth_s is not None:
        raise TrackerError("expected either joint states or smoothing, which does not know them, got both")
    return JointStatesBeside(load_joint_states(run.joint_states, run.model))


def _detection_of(run: OfflineRun, rig: CameraRig, reader: BagReader | None) -> PeopleDetection | None:
    """What finds people; None where no points are compared, or where the run that is made again has recorded its own."""
    recorded = run.from_run and reader is not None and _had_points(reader)
    if KEYPOINTS not in run.config.modalities or recorded:
        return None
    return PeopleDetection(rig, run.config, run.detection)


def _had_points(reader: BagReader) -> bool:
    """Whether the run of a bag compared points: live, perhaps without any that came."""
    modalities = run_info(reader.path).get("parameters", {}).get("modalities", ())
    return KEYPOINTS in modalities or bool(reader.topics_of_type(KEYPOINTS_MESSAGE))


def _recorded_of(run: OfflineRun, rig: CameraRig, stream: ImageSetStream) -> RecordedPeople | None:
    """The people in files; None where there are none."""
    if run.points is None:
        return None
    if KEYPOINTS not in run.config.modalities:
        using = ", ".join([*run.config.modalities, KEYPOINTS])
        raise TrackerError(f"points in {run.points.path} take the modality keypoints: set modalities: [{using}]")
    if not isinstance(stream, SourceStream):
        raise TrackerError(f"points in {run.points.path} go by the numbers of images in the rig's sources, got those of a bag")
    recorded = open_recorded_people(run.points, run.model, run.rig, rig, stream.image_numbers())
    stream.notes += recorded.notes
    return recorded


def _detector_name(run: OfflineRun, detection: PeopleDetection | RecordedPeople | None) -> str | None:
    """Of what has found the people that the run uses; empty where that was in an earlier run, None where it uses none."""
    if detection is not None:
        return detection.detector
    return "" if KEYPOINTS in run.config.modalities else None


def _what_mostly(name: str) -> str:
    """What `unobservable` names, without the axis and the smaller parts: they change from set to set."""
    return f"{name.split('(')[0]}some axis" if name.startswith("root ") else name.split()[0]


_EVERY_ROW = 16  # of an image is looked at for colors
_MANY_SETS = 10  # in none of which a camera shows the body, after which that is noted


@dataclass
class _Record:
    """What the summary needs of each estimate."""

    model: ArticulatedModel
    person: np.ndarray | None = None  # place that was asked for
    first: np.ndarray | None = None  # place where the body began
    began: float = field(default_factory=time.perf_counter)
    status: Counter = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)  # of sets in which the body is not tracked
    stamps_ns: list[int] = field(default_factory=list)
    total_ms: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)
    faults: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)
    unobservable_sets: Counter[str] = field(default_factory=Counter)  # sets, by degree of freedom
    used: Counter[str] = field(default_factory=Counter)  # sets in which the body is followed, by camera that gave an image
    seeing: set[str] = field(default_factory=set)  # cameras that have shown some of the body

    def add(self, estimate: TrackEstimate) -> None:
        self.status[estimate.status] += 1
        if estimate.status in (Status.LOST, Status.INITIALIZING) and estimate.status_reason:
            self.reasons[estimate.status_reason] += 1
        self.stamps_ns.append(estimate.stamp_ns)
        self.total_ms.append(estimate.timings.total_ms)
        if estimate.status.has_state:
            self.first = estimate.state.T_world_root[:3, 3] if self.first is None else self.first
            self.iterations.append(estimate.iterations)
            self.residual.append(estimate.residual)
            self.used.update(camera.camera for camera in estimate.cameras if camera.stamp_ns)
            self.seeing.update(camera.camera for camera in estimate.cameras if camera.samples)
        names = [] if estimate.information is None else unobservable(estimate.information, self.model)
        self.unobservable_sets.update(set(map(_what_mostly, names)))
        for fault in estimate.faults:
            sets = self.faults.get((fault.camera, fault.kind), {"sets": 0})["sets"]
            found = {"camera": fault.camera, "kind": fault.kind, "said": fault.text, "since_ns": fault.since_ns, "sets": sets + 1}
            self.faults[fault.camera, fault.kind] = found

    @property
    def notes(self) -> list[str]:
        """Somebody far from the place that was asked for, and cameras that never show the body, where others do."""
        return [*self._elsewhere(), *self._never_seen()]

    def _elsewhere(self) -> list[str]:
        if self.person is None or self.first is None or (away_m := float(np.linalg.norm(self.first - self.person))) <= NEAR_M:
            return []
        asked, began = place_text(self.person), place_text(self.first)
        return [f"person: asked for at {asked}, the nearest was at {began}, {away_m:.1f} m away: is it somebody else?"]

    def _never_seen(self) -> list[str]:
        if not self.seeing:
            return []
        never = [name for name, sets in self.used.items() if sets >= _MANY_SETS and name not in self.seeing]
        told = "shows the body in none of its image sets: does it look elsewhere? (tracker_node rig check RIG)"
        return [f"{name} {told}" for name in never]


def _without_colors(image_set: ImageSet, config: TrackerConfig) -> list[str]:
    """Says which images are gray, where outlines alone are to tell the body by its colors."""
    if REGION not in config.modalities or KEYPOINTS in config.modalities:
        return []
    rows = {image.camera: image.pixels[::_EVERY_ROW] for image in image_set.images}
    gray = [name for name, of in rows.items() if np.ptp(of) and (of == of[:, :, :1]).all()]
    told = f"{', '.join(gray)} without colors, by which region tells a body: chamfer with backgrounds, or points, tell more"
    return [told] if gray else []


def _track(
    run: OfflineRun, loop: TrackingLoop, stream: ImageSetStream, followers: _Followers, progress: Progress | None
) -> None:
    together = loop.tracker
    assert isinstance(together, Bodies)
    for n, image_set in enumerate(stream, 1):
        if n == 1:
            stream.notes += _without_colors(image_set, run.config)
        worst = loop.step(image_set)
        followers.take(together, loop.tracked_set or image_set)
        if isinstance(stream, RecordedRunStream) and len(together.estimates) == 1 and not run.asked.get("config"):
            stream.compare(next(iter(together.estimates.values())))
        if progress is not None:
            progress(n, min((sets for sets in (stream.n_expected, run.max_sets) if sets), default=None), worst)
        if run.max_sets is not None and n >= run.max_sets:
            return


def _summary(
    run: OfflineRun, stream: ImageSetStream, record: _Record, detection: PeopleDetection | RecordedPeople | None
) -> dict[str, Any]:
    summary: dict[str, Any] = {
        **counted_sets(record.status),
        **asked_of_run(run.asked, run.config, stream.n_expected),
        "ms_per_set": _percentiles(record.total_ms),
        "iterations": {"mean": _mean(record.iterations), "max": max(record.iterations, default=0)},
        "residual": _percentiles(record.residual),
        "residual_unit": run.config.residual_unit,
        "wall_s": time.perf_counter() - record.began,
        "first_stamp_ns": record.stamps_ns[0] if record.stamps_ns else None,
        "last_stamp_ns": record.stamps_ns[-1] if record.stamps_ns else None,
        "images": stream.counters,
        "image_sets_not_formed": stream.sets_not_formed,
        "contradicted_cameras": list(record.faults.values()),
        "unobservable": [{"what": what, "sets": sets} for what, sets in record.unobservable_sets.most_common()],
        "errors": list(stream.errors),
        "notes": [*stream.notes, *record.notes],
        "reason": record.reasons.most_common(1)[0][0] if record.reasons else "",
    }
    if detection is not None:
        summary["detection"] = detection.summary()
    if isinstance(stream, RecordedRunStream):
        summary["sets_not_made_again"] = stream.incomplete_sets
    return summary


def _percentiles(values: list[float]) -> dict[str, float | None]:
    if not values:
        return {"p50": None, "p95": None, "max": None}
    p50, p95 = (float(v) for v in np.percentile(values, [50, 95]))
    return {"p50": p50, "p95": p95, "max": float(max(values))}


def _mean(values: list[int]) -> float | None:
    return float(np.mean(values)) if values else None
