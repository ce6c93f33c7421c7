"""Images that never came are counted by the numbers of their publishers: a real middleware, and real losses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image
from std_msgs.msg import String

from helpers.ros.processes import wait_until
from tracker_node.ros.conversions import image_message
from tracker_node.ros.diagnostics import Diagnostics, QosMismatches
from tracker_node.ros.executor import make_executor
from tracker_node.ros.qos import RESULT, SequenceGaps, images_published, images_subscribed, with_number
from tracker_node.ros.tracker.image_inbox import ImageInbox, InboxOptions

CAMERA = "cam1"
TOO_MANY = images_subscribed(lossless=False).depth + 10  # for a subscription that nobody takes from


@pytest.fixture
def inbox(probe):
    """Of one camera, as the tracker has it where it watches live."""
    node = Node("receiver")
    probe.add_node(node)
    inbox = ImageInbox(node, [CAMERA], InboxOptions(), QosMismatches(node, Diagnostics(node)))
    inbox.subscribe([CAMERA])
    yield inbox
    node.destroy_node()


def publishers_of(inbox) -> int:
    """That the inbox is connected to."""
    return inbox._subscriptions[CAMERA][0].get_publisher_count()


class Camera:
    """A publisher of images that the inbox has found."""

    def __init__(self, probe, inbox):
        self._probe, self._inbox = probe, inbox
        before = publishers_of(inbox)
        self.publisher = probe.node.create_publisher(Image, f"{CAMERA}/image_raw", images_published(50))
        probe.spin_until(lambda: publishers_of(inbox) > before and self.publisher.get_subscription_count() == 1, "a connection")

    def publish(self, n: int = 1) -> None:
        """Nobody takes them meanwhile."""
        for i in range(n):
            self.publisher.publish(image_message(i, "f", np.zeros((4, 4, 3), np.uint8)))

    def send(self, n: int = 1) -> None:
        """Each is taken before the next is published."""
        for _ in range(n):
            before = self._inbox.arrived[CAMERA]
            self.publish()
            self._probe.spin_until(lambda n=before: self._inbox.arrived[CAMERA] == n + 1, "arrival")


def test_images_that_newer_ones_replaced_are_counted(probe, inbox):
    camera = Camera(probe, inbox)
    camera.send()
    camera.publish(TOO_MANY)
    probe.spin_until(lambda: inbox.arrived[CAMERA] + inbox.lost[CAMERA] == 1 + TOO_MANY, "every image, come or lost")
    assert inbox.lost[CAMERA] > 0 and inbox.arrived[CAMERA] > 1
    lost = inbox.lost[CAMERA]
    camera.send(3)
    assert inbox.lost[CAMERA] == lost


def test_losses_of_earlier_subscriptions_are_kept(probe, inbox):
    camera = Camera(probe, inbox)
    camera.send()
    camera.publish(TOO_MANY)
    probe.spin_until(lambda: inbox.arrived[CAMERA] + inbox.lost[CAMERA] == 1 + TOO_MANY, "every image, come or lost")
    inbox.subscribe(())
    probe.spin_until(lambda: camera.publisher.get_subscription_count() == 0, "the end of the subscription")
    camera.publish(7)  # for nobody
    inbox.subscribe([CAMERA])
    probe.spin_until(lambda: publishers_of(inbox) == camera.publisher.get_subscription_count() == 1, "another subscription")
    camera.send(3)
    assert inbox.arrived[CAMERA] + inbox.lost[CAMERA] == 4 + TOO_MANY


def test_cameras_that_come_go_and_stand_in_for_each_other_lose_nothing(probe, inbox):
    first = Camera(probe, inbox)
    first.send(30)
    second = Camera(probe, inbox)
    for _ in range(5):
        first.send(2)
        second.send()
    probe.node.destroy_publisher(first.publisher)
    second.send(2)
    probe.spin_until(lambda: publishers_of(inbox) == 1, "the end of the first")
    Camera(probe, inbox).send(3)
    assert inbox.arrived[CAMERA] == 50 and inbox.lost[CAMERA] == 0


@pytest.mark.parametrize("executor", [make_executor, SingleThreadedExecutor])
def test_numbers_come_with_the_messages_whatever_the_executor(ros, executor):
    node, executing, found = Node("listener"), executor(), []
    executing.add_node(node)
    node.create_subscription(String, "spoken", with_number(lambda message, number: found.append((message.data, number))), RESULT)
    publisher = node.create_publisher(String, "spoken", RESULT)
    wait_until(lambda: publisher.get_subscription_count() == 1)
    for word in "abc":
        publisher.publish(String(data=word))

    def all_there() -> bool:
        executing.spin_once(timeout_sec=0.05)
        return len(found) == 3

    wait_until(all_there)
    assert found == [("a", 1), ("b", 2), ("c", 3)]
    executing.shutdown()
    node.destroy_node()


@given(first=st.integers(1, 2**40), arrives=st.lists(st.booleans(), max_size=60))
def test_every_gap_of_one_publisher_is_counted(first, arrives):
    gaps = SequenceGaps(lambda: 1)
    came = [first, *(first + 1 + i for i, there in enumerate(arrives) if there)]
    for number in came:
        gaps.came(number)
    assert gaps.lost == came[-1] - first + 1 - len(came)


@given(st.lists(st.tuples(st.integers(0, 1), st.booleans()), max_size=100))
def test_gaps_of_two_publishers_add_up(sent):
    gaps, latest, lost = SequenceGaps(lambda: 2), [7, 500], 0  # farther apart than either loses
    for number in latest:
        gaps.came(number)
    waiting = [0, 0]  # lost, and not yet noticed
    for publisher, arrives in sent:
        latest[publisher] += 1
        waiting[publisher] += not arrives
        if arrives:
            gaps.came(latest[publisher])
            lost, waiting[publisher] = lost + waiting[publisher], 0
    assert gaps.lost == lost


def test_a_message_without_a_number_says_nothing():
    gaps = SequenceGaps(lambda: 1)
    for number in (10, None, 12):
        gaps.came(number)
    assert gaps.lost == 1


def test_an_image_may_come_while_its_subscription_is_being_made(probe):
    class Eager(Node):
        def create_subscription(self, kind, topic, callback, *args, **options):
            if kind is Image:
                callback(b"", {"publication_sequence_number": 5})
            return super().create_subscription(kind, topic, callback, *args, **options)

    node = Eager("receiver")
    inbox = ImageInbox(node, [CAMERA], InboxOptions(), QosMismatches(node, Diagnostics(node)))
    inbox.subscribe([CAMERA])
    assert inbox.arrived[CAMERA] == 1 and inbox.lost[CAMERA] == 0
    node.destroy_node()


def test_a_publisher_that_was_killed_is_forgotten_when_the_middleware_has_noticed():
    publishers = 1
    gaps = SequenceGaps(lambda: publishers)
    for number in (900, 901):
        gaps.came(number)
    publishers = 2  # another has come, and the first is still believed to be there
    for number in (1, 2, 5):
        gaps.came(number)
    assert gaps.lost == 2
    publishers = 1
    for number in (6, 950):
        gaps.came(number)
    assert gaps.lost == 2 + 943
