"""What latched topics have said last is told again at the beginning of each file."""

from tracker_node.loaders.bag.latched import LatchedMessages
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.metadata import OfferedQos, TopicRecord

LATCHED = OfferedQos(durability="transient_local")
TRANSFORMS = "tf2_msgs/msg/TFMessage"


def topic(name, kind="std_msgs/msg/String", qos=LATCHED):
    return TopicRecord(name, kind, "", qos)


def transforms(*frames, x=0.0):
    types = typestore().types
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    listed = [
        types["geometry_msgs/msg/TransformStamped"](
            header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="world"), child_frame_id=frame,
            transform=types["geometry_msgs/msg/Transform"](
                translation=types["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0),
                rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )
        for frame in frames
    ]  # fmt: skip
    return bytes(typestore().serialize_cdr(types[TRANSFORMS](transforms=listed), TRANSFORMS))


def frames_of(data):
    said = typestore().deserialize_cdr(data, TRANSFORMS)
    return {one.child_frame_id: one.transform.translation.x for one in said.transforms}


def test_the_last_message_is_told_once_in_each_file():
    kept = LatchedMessages(True)
    kept.keep(topic("/a"), 1, b"old")
    kept.keep(topic("/a"), 2, b"new")
    assert kept.take("/b") == []  # the file in which it was said
    for _ in range(2):
        kept.begin_file()
        assert kept.told == set()
        assert kept.take("/b") == [("/a", 2, b"new")]
        assert kept.told == {"/a"}
        assert kept.take("/b") == []


def test_a_topic_that_speaks_first_itself_is_not_told_before():
    kept = LatchedMessages(True)
    kept.keep(topic("/a"), 1, b"a")
    kept.keep(topic("/b"), 2, b"b")
    kept.begin_file()
    assert kept.take("/a") == [("/b", 2, b"b")]
    assert kept.told == {"/b"}


def test_what_is_not_latched_or_not_wanted_is_not_kept():
    for kept, qos in ((LatchedMessages(True), OfferedQos()), (LatchedMessages(False), LATCHED)):
        kept.keep(topic("/a", qos=qos), 1, b"a")
        kept.begin_file()
        assert kept.take("/b") == []


def test_transforms_of_all_frames_are_told_together_the_latest_of_each():
    kept, tf = LatchedMessages(True), topic("/tf_static", TRANSFORMS)
    kept.keep(tf, 1, transforms("left", "right", x=1.0))
    kept.keep(tf, 2, transforms("right", x=2.0))
    kept.keep(topic("/tf_other", TRANSFORMS), 3, transforms("elsewhere"))
    kept.begin_file()
    told = {name: (stamp, frames_of(data)) for name, stamp, data in kept.take("/tf_static")}  # even before its own message
    assert told == {"/tf_static": (2, {"left": 1.0, "right": 2.0}), "/tf_other": (3, {"elsewhere": 0.0})}


def test_transforms_that_cannot_be_read_are_told_as_they_are():
    kept = LatchedMessages(True)
    kept.keep(topic("/tf_static", TRANSFORMS), 1, b"\x00\x01")
    kept.begin_file()
    assert kept.take("/a") == [("/tf_static", 1, b"\x00\x01")]
    kept.begin_file()
    assert kept.take("/tf_static") == []
