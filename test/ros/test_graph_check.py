"""A name that two nodes have, topics of cameras with two publishers, and a clock that does not tick are told, and their end."""

from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image

from tracker_node.ros.diagnostics import Diagnostics, GraphCheck


class Graph:
    """A node whose surroundings the test says."""

    def __init__(self, names=("tracker",), publishers=1, now_ns=0, sim_time=False):
        self.names, self.n, self.now_ns = [(name, "/lab") for name in names], publishers, now_ns
        self.publishers = [SimpleNamespace(msg_type=Image, topic_name=f"/cam{i}/image_raw") for i in range(6)]
        self.subscriptions = [SimpleNamespace(msg_type=CameraInfo, topic_name="/cam1/camera_info"), self.publishers[0]]
        self.sim_time = sim_time

    def get_name(self):
        return "tracker"

    def get_namespace(self):
        return "/lab"

    def get_fully_qualified_name(self):
        return "/lab/tracker"

    def get_node_names_and_namespaces(self):
        return self.names

    def count_publishers(self, topic):
        return self.n if topic.endswith("image_raw") else 7

    def get_clock(self):
        return SimpleNamespace(ros_time_is_active=self.sim_time, now=lambda: SimpleNamespace(nanoseconds=self.now_ns))


TROUBLE = {
    "another node is named /lab/tracker": {"names": ("tracker", "other", "tracker")},
    "2 publishers on /cam0/image_raw, /cam1/image_raw, /cam2/image_raw, /cam3/image_raw and 2 more": {"publishers": 2},
    "use_sim_time is true, and nobody has published /clock": {"sim_time": True},
}


@pytest.mark.parametrize("said", TROUBLE)
def test_what_lasts_is_told(said):
    check = GraphCheck(Graph(**TROUBLE[said]))
    told = [check.problems() for _ in range(30)]
    assert told[:4] == [[]] * 4 and (told[23] == [] or "clock" in said)  # a node that was killed is seen for 20 s
    (text,) = told[-1]
    assert text.startswith(said)


@pytest.mark.parametrize("changes", [{}, {"sim_time": True, "now_ns": 5}, {"publishers": 0}, {"names": ("tracker", "links")}])
def test_what_is_usual_is_no_problem(changes):
    check = GraphCheck(Graph(**changes))
    assert not any(check.problems() for _ in range(40))


def test_what_passes_is_not_told():
    graph = Graph(publishers=2)
    check = GraphCheck(graph)
    for n in (*[2] * 20, 1, *[2] * 20):
        graph.n = n
        assert check.problems() == []


def test_diagnostics_tell_it_and_its_end(probe):
    """Two nodes of one name, with one topic; and a clock that begins to tick."""
    nodes = [Node("twin", parameter_overrides=[Parameter("use_sim_time", value=True)]) for _ in range(2)]
    for node in nodes:
        probe.add_node(node)
        node.create_publisher(Image, "cam1/image_raw", 1)
    diagnostics = Diagnostics(nodes[0], period_s=0.05)

    def part() -> DiagnosticStatus:
        return probe.diagnostics.get("twin: graph", DiagnosticStatus())

    wanted = ("another node is named /twin", "2 publishers on /cam1/image_raw", "nobody has published /clock")
    probe.spin_until(lambda: all(text in part().message for text in wanted), "the warning")
    assert part().level == DiagnosticStatus.WARN
    nodes[1].destroy_node()
    clock = probe.node.create_publisher(Clock, "/clock", 1)
    message = Clock()
    message.clock.sec = 7

    def ticked() -> bool:
        clock.publish(message)
        return part().level == DiagnosticStatus.OK

    probe.spin_until(ticked, "its end")
    assert diagnostics and "nothing" in part().message
    nodes[0].destroy_node()
