"""Topics into a bag, bytes as they are.

Subscriptions are made as topics appear, with the quality of service that their publishers offer. Where nobody publishes yet,
it is what nearly all publishers offer (reliable and volatile; transient local for the topics that ROS latches), so that no
publisher warns of a subscriber that does not match. A publisher that offers something else gets a second subscription, and the
first one is destroyed. Callbacks only enqueue; a thread of its own writes.
"""

from __future__ import annotations

import re
import time
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidTopicNameException
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.validate_full_topic_name import validate_full_topic_name
from std_srvs.srv import SetBool, Trigger

from ...errors import TrackerError
from ...loaders.bag.images import COMPRESSED, RAW
from ...loaders.bag.message_types import TRACKED_STATE, MessageType, UnknownMessageTypeError, message_type
from ...loaders.bag.metadata import OfferedQos
from ...loaders.bag.queue import BagQueue
from ...tracking.estimate import Status
from ..conversions import message_class
from ..diagnostics import Diagnostics
from ..guarded_node import GuardedNode
from ..qos import offered_qos, qos_profile, with_source_stamp
from .recorder_report import ON_OCCASION, WHILE_KNOWN, RecorderState, TopicPace, topics_status

DISCOVERY_S = 0.1
REPORT_S = 1.0
RATE_OVER_S = 10.0
DEPTH = 100  # messages of a topic that may wait for the event loop
_LATCHED_BY_ROS = ("/tf_static", "/robot_description", "/map")  # ends of the names of topics
_MOST_STAMPS = 10 * DEPTH  # of messages that came before the publishers were known
_NOT_KNOWN = {int(status) for status in Status if not status.known}
IMAGE_CHOICES = {"all": (RAW, COMPRESSED), "raw": (RAW,), "compressed": (COMPRESSED,), "none": ()}


def is_topic_name(name: str) -> bool:
    """Whether ROS takes this for the full name of a topic."""
    try:
        return validate_full_topic_name(name)
    except InvalidTopicNameException:
        return False


@dataclass(frozen=True)
class TopicSelection:
    """Which topics are recorded.

    Parameters
    ----------
    names : full topic names; those with a type are subscribed to before anybody publishes them.
    patterns : regular expressions that a whole topic name matches.
    exclude : regular expressions of topics to leave out, whatever else asks for them.
    images : a key of `IMAGE_CHOICES`.
    """

    names: dict[str, str | None] = field(default_factory=dict)
    patterns: tuple[re.Pattern[str], ...] = ()
    exclude: tuple[re.Pattern[str], ...] = ()
    images: str = "all"

    def wants(self, topic: str, type_name: str) -> bool:
        """Whether a topic is recorded; hidden ones (a part begins with ``_``) only by their full name.

        Parameters
        ----------
        topic : full name.
        type_name : such as ``sensor_msgs/msg/Image``.

        Returns
        -------
        wanted : whether names or patterns select it, and nothing leaves it out.
        """
        if type_name in (RAW, COMPRESSED) and type_name not in IMAGE_CHOICES[self.images]:
            return False
        if any(pattern.fullmatch(topic) for pattern in self.exclude):
            return False
        return topic in self.names or ("/_" not in topic and any(pattern.fullmatch(topic) for pattern in self.patterns))


@dataclass
class _Recorded:
    """One topic that is being recorded; ``lost_before`` were lost by the subscription that this one stands for now.

    ``state``: the latest message, of a topic of tracked states.
    ``guessed``: no publisher was known when the quality of service was chosen. ``stamps`` are those of messages that came in that
    time, which a transient-local publisher sends once more to the next subscription.
    """

    type_name: str
    qos: OfferedQos
    guessed: bool = False
    stamps: set[int] = field(default_factory=set)
    lost_before: int = 0
    subscription: Subscription | None = None
    announced: bool = False
    pace: TopicPace = field(default_factory=TopicPace)
    state: bytes | None = None


class RecorderNode(GuardedNode):
    """Records the selected topics.

    The services ``~/pause`` (std_srvs/SetBool) and ``~/split`` (std_srvs/Trigger) leave out what comes for a while, and begin
    another file of the bag.

    Attributes
    ----------
    lost : topic -> messages that the middleware did not deliver.
    problems : topic -> why it is not recorded.
    """

    def __init__(self, selection: TopicSelection, bag: BagQueue):
        super().__init__("recorder")
        self._selection, self._bag = selection, bag
        self._topics: dict[str, _Recorded] = {}
        self._replaced: list[_Recorded] = []
        self._offered_less: set[str] = set()  # topics with a publisher that does not reach our subscription
        self._paused = False
        # When, and messages, bytes and dropped messages then; rates are those of the last seconds.
        self._reported = deque([(time.monotonic(), 0, 0, 0)], maxlen=round(RATE_OVER_S / REPORT_S))
        self.lost: Counter[str] = Counter()
        self.problems: dict[str, str] = {}
        self.last_message_s = time.monotonic()
        self._sim_time = bool(self.get_parameter("use_sim_time").value)
        self._diagnostics = Diagnostics(self, "recorder")
        for topic, type_name in selection.names.items():
            if type_name and selection.wants(topic, type_name):
                publishers = self.get_publishers_info_by_topic(topic)
                if publishers:
                    self._subscribe(topic, type_name, offered_qos([p.qos_profile for p in publishers]))
                else:
                    self._subscribe(topic, type_name, _usual_qos(topic), guessed=True)
        self._discovery = self.create_timer(DISCOVERY_S, self.discover)
        self._reporting = self.create_timer(REPORT_S, self.report)
        self._pause_service = self.create_service(SetBool, "~/pause", self._on_pause)
        self._split_service = self.create_service(Trigger, "~/split", self._on_split)
        self.discover()

    @property
    def topics(self) -> dict[str, str]:
        """Topic -> type of everything that is subscribed to."""
        return {topic: recorded.type_name for topic, recorded in self._topics.items()}

    @property
    def bag_problem(self) -> str:
        """Why the bag cannot be written any more; empty if it can."""
        return self._bag.problem

    def discover(self) -> None:
        """Subscribe to what has appeared since the last time."""
        guessed = [topic for topic, recorded in self._topics.items() if recorded.guessed and self.count_publishers(topic)]
        for topic in self._offered_less.union(guessed):
            self._ask_anew(topic)
        for topic, type_names in self.get_topic_names_and_types():
            if topic in self._topics or topic in self.problems or not self._selection.wants(topic, type_names[0]):
                continue
            publishers = self.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            if len(type_names) > 1:
                self._refuse(topic, f"several types on one topic: {', '.join(type_names)}")
                continue
            self._subscribe(topic, type_names[0], offered_qos([p.qos_profile for p in publishers]))

    def _subscribe(self, topic: str, type_name: str, qos: OfferedQos, guessed: bool = False) -> None:
        try:
            class_ = message_class(type_name)
        except TrackerError as error:
            self._refuse(topic, str(error))
            return
        recorded = self._topics[topic] = _Recorded(type_name, qos, guessed, pace=TopicPace(on_occasion=type_name in ON_OCCASION))
        wanted = OfferedQos(qos.reliability, qos.durability, "keep_last", DEPTH)
        events = SubscriptionEventCallbacks(
            message_lost=lambda status: self._on_lost(topic, recorded, status.total_count),  # type: ignore[attr-defined]
            incompatible_qos=lambda status: self._on_incompatible(topic, recorded),
            use_default_callbacks=False,
        )

        def on_message(data: bytes, stamp_ns: int | None) -> None:
            if self._topics[topic] is recorded and not _came_before(recorded, stamp_ns):
                self._on_message(topic, recorded, data)

        recorded.subscription = self.create_subscription(
            class_, topic, with_source_stamp(on_message), qos_profile(wanted), event_callbacks=events, raw=True
        )

    def _refuse(self, topic: str, problem: str) -> None:
        self.problems[topic] = problem
        self.get_logger().error(f"{topic} is not recorded: {problem}")

    def _on_message(self, topic: str, recorded: _Recorded, data: bytes) -> None:
        self.last_message_s = time.monotonic()
        if self._paused:
            return
        recorded.pace.add()
        if recorded.type_name == TRACKED_STATE:
            recorded.state = data
        if not recorded.announced:
            self._announce(topic, recorded)
        stamp_ns = self.get_clock().now().nanoseconds if self._sim_time else time.time_ns()
        self._bag.put(topic, stamp_ns, data)

    def _announce(self, topic: str, recorded: _Recorded) -> None:
        """To the bag, with what the publishers say of themselves."""
        publishers = self.get_publishers_info_by_topic(topic)
        qos = offered_qos([p.qos_profile for p in publishers]) if publishers else recorded.qos
        self._bag.add_topic(topic, recorded.type_name, qos, _definition(recorded.type_name, publishers))
        recorded.announced = True

    def _on_lost(self, topic: str, recorded: _Recorded, total: int) -> None:
        """``total`` is of this subscription: events that come together are reported once."""
        if self._topics[topic] is recorded:
            self.lost[topic] = max(self.lost[topic], recorded.lost_before + total)

    def _on_incompatible(self, topic: str, recorded: _Recorded) -> None:
        """Somebody publishes with less than we asked for before we knew."""
        if self._topics[topic] is recorded:
            self._offered_less.add(topic)
            self._ask_anew(topic)

    def _ask_anew(self, topic: str) -> None:
        """Subscribe with what all publishers offer, once the graph lists the one that offers something else."""
        recorded = self._topics[topic]
        publishers = self.get_publishers_info_by_topic(topic)
        if not publishers:
            return
        recorded.guessed = False
        offered = offered_qos([p.qos_profile for p in publishers])
        if (offered.reliability, offered.durability) == (recorded.qos.reliability, recorded.qos.durability):
            recorded.stamps.clear()
            return
        self._offered_less.discard(topic)
        self._replaced.append(recorded)
        self._subscribe(topic, recorded.type_name, offered)
        renewed = self._topics[topic]
        renewed.announced, renewed.pace, renewed.stamps = recorded.announced, recorded.pace, recorded.stamps
        renewed.lost_before = self.lost[topic]

    def _destroy_replaced(self) -> None:
        """Publishers hold a dead reader for a subscriber that does not match; called when it has been replaced for a while."""
        for recorded in self._replaced:
            assert recorded.subscription is not None
            self.destroy_subscription(recorded.subscription)
        self._replaced = []

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if self._paused and not request.data:
            for recorded in self._topics.values():
                recorded.pace.begin_again()
        self._paused = request.data
        response.success, response.message = True, "paused" if request.data else "recording"
        self.report()
        return response

    def _on_split(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._bag.split()
        response.success = not self._bag.problem
        response.message = self._bag.problem or f"file {self._bag.n_files} ends here"
        return response

    def report(self) -> None:
        """Say on /diagnostics how it goes."""
        self._destroy_replaced()
        paces = {topic: recorded.pace for topic, recorded in self._topics.items()}
        due = [] if self._paused else paces.keys() - self._not_due()
        published = {topic: self.count_publishers(topic) for topic in due}
        self._diagnostics.report("topics", *topics_status(paces, self.lost, published, time.monotonic()))
        state = self._state()
        self._diagnostics.report("bag", *state.status(), state.values())

    def _not_due(self) -> set[str]:
        """Topics that trackers leave out now, since they do not know where the body is."""
        found: set[str] = set()
        for topic, recorded in self._topics.items():
            if recorded.state is not None:
                status = deserialize_message(recorded.state, message_class(TRACKED_STATE)).status
                if status in _NOT_KNOWN:
                    found |= {"/tf", *(topic.removesuffix("state") + name for name in WHILE_KNOWN)}
        return found

    def _state(self) -> RecorderState:
        bag, now_s = self._bag, time.monotonic()
        messages, size, dropped = sum(bag.written.values()), bag.size, sum(bag.dropped.values())
        then_s, messages_then, size_then, _ = self._reported[0]
        dropped_then = self._reported[-1][3]
        self._reported.append((now_s, messages, size, dropped))
        passed_s = max(now_s - then_s, 1e-3)
        free = bag.free_bytes
        return RecorderState(
            problem=bag.problem,
            paused=self._paused,
            messages=messages,
            size=size,
            free_bytes=free,
            room_bytes=max(0, free - bag.min_free_bytes),
            waiting=bag.waiting_bytes / bag.limit_bytes,
            unsaved_s=bag.unsaved_s,
            lost=sum(self.lost.values()),
            dropped=dropped,
            dropping=dropped > dropped_then,
            bytes_per_s=(size - size_then) / passed_s,
            messages_per_s=(messages - messages_then) / passed_s,
            topics=len(self._topics),
            files=bag.n_files,
            refused=self.problems,
        )


def _usual_qos(topic: str) -> OfferedQos:
    """What a publisher will offer, by the name of its topic."""
    return OfferedQos("reliable", "transient_local" if topic.endswith(_LATCHED_BY_ROS) else "volatile")


def _came_before(recorded: _Recorded, stamp_ns: int | None) -> bool:
    """Whether the subscription before this one has had the message already."""
    if stamp_ns is None:
        return False
    if recorded.guessed:
        if len(recorded.stamps) < _MOST_STAMPS:
            recorded.stamps.add(stamp_ns)
        return False
    if stamp_ns not in recorded.stamps:
        return False
    recorded.stamps.discard(stamp_ns)
    return True


def _definition(type_name: str, publishers: Iterable[TopicEndpointInfo]) -> MessageType:
    """What the bag says of a type; without its text, if that is nowhere, but with the publishers' hash."""
    try:
        return message_type(type_name)
    except UnknownMessageTypeError:
        announced = next((str(p.topic_type_hash) for p in publishers), "")
        return MessageType(type_name, "", announced)
