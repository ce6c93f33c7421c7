"""Work shared by threads: the results are those of a plain loop."""

import threading

import pytest

from tracker_node.parallel import Workers


@pytest.mark.parametrize("threads", [1, 2, 3, 8])
@pytest.mark.parametrize("n", [0, 1, 2, 5, 9])
def test_results_are_in_the_order_of_the_items(threads, n):
    assert Workers(threads).map(lambda x: x * x, list(range(n))) == [x * x for x in range(n)]


def test_each_item_is_done_once():
    done = []
    Workers(3).map(done.append, list(range(7)))
    assert sorted(done) == list(range(7))


def test_all_threads_work_at_the_same_time():
    """As many as there are threads meet; with fewer the barrier would break."""
    barrier = threading.Barrier(3, timeout=30.0)
    names = Workers(3).map(lambda _: (barrier.wait(), threading.current_thread().name)[1], [0, 1, 2])
    assert len(set(names)) == 3
    assert threading.current_thread().name in names


def test_two_items_are_shared_by_two():
    barrier = threading.Barrier(2, timeout=30.0)
    assert len(set(Workers(4).map(lambda _: (barrier.wait(), threading.get_ident())[1], [0, 1]))) == 2


@pytest.mark.parametrize(("threads", "n"), [(1, 4), (4, 1)])
def test_the_calling_thread_works_alone_where_nothing_can_be_shared(threads, n):
    names = Workers(threads).map(lambda _: threading.current_thread().name, [0] * n)
    assert set(names) == {threading.current_thread().name}


def test_what_fails_in_a_thread_fails_here():
    def fail(x):
        if x == 1:
            raise ValueError("the second")

    with pytest.raises(ValueError, match="the second"):
        Workers(2).map(fail, [0, 1, 2])


def test_nobody_else_makes_a_pool(repository):
    makers = {f.name for f in (repository / "tracker_node").rglob("*.py") if "ThreadPoolExecutor" in f.read_text()}
    assert makers == {"parallel.py", "executors.py"}  # the latter's threads wait for the processes of a batch
