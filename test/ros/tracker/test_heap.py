"""What is kept for ever is left out of garbage collections, and these go on."""

import gc

import pytest

from tracker_node.ros.tracker.heap import kept_for_ever


@pytest.fixture(autouse=True)
def thawed():
    yield
    gc.unfreeze()
    gc.enable()


def test_nothing_is_collected_meanwhile_and_what_was_made_is_left_out_later():
    with kept_for_ever():
        assert not gc.isenabled()
        made = [[] for _ in range(1000)]
    assert gc.isenabled() and gc.get_freeze_count() > len(made)
    assert not any(each is made for each in gc.get_objects())


def test_what_fails_leaves_collections_as_they_were():
    with pytest.raises(ImportError), kept_for_ever():
        raise ImportError
    assert gc.isenabled()
    gc.disable()
    with kept_for_ever():
        pass
    assert not gc.isenabled()
