"""A camera's account: a new one is empty, and every count goes by its own name."""

from tracker_node.ros.ingest.outlet import CameraCounts


def test_nothing_is_counted_at_first():
    assert set(CameraCounts().values().values()) == {0}


def test_counts_go_by_their_names():
    values = CameraCounts(1, 2, 3, 4, 5, 6, 7, 8, 9).values()
    names = ["published", "dropped", "skipped", "late", "duplicated", "missing", "unusable", "unstamped", "connections"]
    assert values == {name: i for i, name in enumerate(names, start=1)}
