"""A running graph in Rerun's viewer: states, covariances and images of a tracker, as they come."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from sensor_msgs.msg import CompressedImage, Image
from tracker_msgs.msg import StateCovariance, TrackedState

from ..camera.rig import CameraRig
from ..errors import TrackerError
from ..loaders.bag.message_types import stamp_ns_of
from ..model.articulated import ArticulatedModel
from ..runs.data import RunData
from ..runs.load import run_of_messages
from ..watch.view import APPLICATION, RerunView, rerun_module, words
from .conversions import bgr_of_compressed, decode_raw_image
from .guarded_node import GuardedNode
from .qos import LIVE_IMAGES, RESULT

_KEPT = 64  # states and stamps of images, until what belongs to them comes


@dataclass(frozen=True, eq=False)
class BridgeOptions:
    """What is shown, and where.

    Parameters
    ----------
    models : bodies by the names that their topics have; "" for one that is alone.
    rig : cameras, with the lenses of the images.
    tracker : name of the tracker's node.
    output : file; None: the viewer at ``address`` gets everything.
    address : of a viewer.
    image_rate_hz : at most so many images a second of each camera; 0: none.
    compressed : subscribe to JPEG images.
    """

    models: Mapping[str, ArticulatedModel]
    rig: CameraRig
    tracker: str = "tracker"
    output: Path | None = None
    address: str = "rerun+http://127.0.0.1:9876/proxy"
    image_rate_hz: float = 10.0
    compressed: bool = False


class RerunBridge(GuardedNode):
    """Subscribes to a tracker and its cameras, and hands on what comes.

    Attributes
    ----------
    fatal : why nothing can be shown; None while all is well.
    sets : image sets shown so far.
    """

    def __init__(self, options: BridgeOptions):
        super().__init__("rerun_bridge")
        self._options, self.sets = options, 0
        self._view: RerunView | None = None
        self.fatal: TrackerError | None = None
        self._recording = rerun_module().RecordingStream(APPLICATION)
        if options.output is not None:
            options.output.parent.mkdir(parents=True, exist_ok=True)
            self._recording.save(options.output)
        else:
            self._recording.connect_grpc(options.address)
        self._covariances: dict[str, OrderedDict[int, np.ndarray]] = {name: OrderedDict() for name in options.models}
        self._states: deque[tuple[str, RunData, dict[str, int]]] = deque(maxlen=_KEPT)
        self._shown: dict[str, deque[int]] = {name: deque(maxlen=_KEPT) for name in options.rig.names}
        for name in options.models:
            topic = "/".join(filter(None, (options.tracker, name, "state")))
            self.create_subscription(StateCovariance, f"{topic}_covariance", partial(self._take_covariance, name), RESULT)
            self.create_subscription(TrackedState, topic, partial(self._take_state, name, topic), RESULT)
        kind, suffix = (CompressedImage, "/compressed") if options.compressed else (Image, "")
        for name in options.rig.names if options.image_rate_hz else ():
            topic, take = f"{name}/image_raw{suffix}", partial(self._take_image, name)
            self.create_subscription(kind, topic, take, LIVE_IMAGES, raw=not options.compressed)

    def close(self) -> None:
        """Hand on what is left, and end the file."""
        self._recording.flush()
        self._recording.disconnect()

    def _begun(self, stamp_ns: int) -> RerunView:
        """The view; its time begins with the first message."""
        if self._view is None:
            options = self._options
            self._view = RerunView(self._recording, options.models, options.rig, stamp_ns, options.image_rate_hz > 0)
        return self._view

    def _take_covariance(self, body: str, message: StateCovariance) -> None:
        kept = self._covariances[body]
        kept[stamp_ns_of(message.header.stamp)] = np.asarray(message.covariance)
        if len(kept) > _KEPT:
            kept.popitem(last=False)

    def _take_state(self, body: str, topic: str, message: TrackedState) -> None:
        try:
            run = run_of_messages(Path(topic), topic, [message], self._covariances[body]).without_guesses()
            run.check_model(self._options.models[body], "--model")
        except TrackerError as error:
            self.fatal = error
            return
        stamp_ns = stamp_ns_of(message.header.stamp)
        view = self._begun(stamp_ns)
        view.show(body, run)
        view.say(body, stamp_ns, words(run, 0, message.status_reason))
        self.sets += 1
        stamps = dict(zip(message.cameras, map(stamp_ns_of, message.camera_stamps), strict=True))
        self._states.append((body, run, stamps))
        for camera, at_ns in stamps.items():
            if at_ns in self._shown.get(camera, ()):
                view.show_outlines(camera, at_ns, body, run, 0)

    def _take_image(self, camera: str, message: CompressedImage | bytes) -> None:
        shown = self._shown[camera]
        image = decode_raw_image(camera, message) if isinstance(message, bytes) else bgr_of_compressed(camera, message)
        stamp_ns = image.stamp_ns
        if shown and abs(stamp_ns - shown[-1]) < 0.95e9 / self._options.image_rate_hz:
            return
        view = self._begun(stamp_ns)
        view.show_image(camera, stamp_ns, image.bgr)
        shown.append(stamp_ns)
        for body, run, stamps in self._states:
            if stamps.get(camera) == stamp_ns:
                view.show_outlines(camera, stamp_ns, body, run, 0)
