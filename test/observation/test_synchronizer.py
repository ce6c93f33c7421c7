"""The synchronizer: what holds for any images in any order, and the situations that rigs get into."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracker_node.errors import UnknownNameError
from tracker_node.observation.image_set import CameraImage
from tracker_node.observation.synchronizer import REASONS, SET_REASONS, ImageSynchronizer

PERIOD_NS = 20_000_000
TOLERANCE_NS = 8_000_000
CAMERAS = ("left", "middle", "right")
PIXELS = np.zeros((1, 1), dtype=np.uint8)


def image(camera, stamp_ns):
    return CameraImage(camera, stamp_ns, PIXELS, "mono8")


def synchronizer(min_cameras=0, queue_s=0.2, cameras=CAMERAS, tolerance=0.4):
    return ImageSynchronizer(
        cameras,
        image_period_s=PERIOD_NS * 1e-9,
        tolerance=tolerance,
        queue_s=queue_s,
        min_cameras=min_cameras,
    )


def run(sync, stamps, flush=True):
    """Sets out of (camera, stamp) pairs put in one by one."""
    sets = [image_set for camera, stamp in stamps for image_set in sync.add(image(camera, stamp))]
    return sets + (sync.flush() if flush else [])


def summary(sets):
    return [tuple((x.camera, x.stamp_ns) for x in image_set.images) for image_set in sets]


def assert_accounts(sync, n_images):
    counters = sync.counters
    for counts in counters.values():
        kept = counts["used"] + counts["waiting"] + sum(counts[reason] for reason in REASONS)
        assert counts["received"] == kept, counts
        assert min(counts.values()) >= 0
    assert sum(c["received"] for c in counters.values()) == n_images


# Stamps on a coarse grid meet the tolerance exactly, repeat, and go backward far enough to be clock jumps.
stamps = st.integers(0, 60).map(lambda n: n * PERIOD_NS // 5) | st.integers(0, 40 * PERIOD_NS)
any_order = st.lists(st.tuples(st.sampled_from(CAMERAS), stamps), max_size=80)


@settings(max_examples=300, deadline=None)
@given(any_order, st.integers(0, 3), st.sampled_from((0.0, 0.04, 0.2)), st.sampled_from((0.0, 0.4)))
def test_any_images_in_any_order(puts, min_cameras, queue_s, tolerance):
    sync = synchronizer(min_cameras, queue_s, tolerance=tolerance)
    end_ns, used, jumps = -1, [], 0
    for number, (camera, stamp) in enumerate(puts, start=1):
        sets = sync.add(image(camera, stamp))
        if sync.clock_jumps > jumps:
            end_ns, jumps, used = -1, sync.clock_jumps, []
        for image_set in sets:
            found = [x.stamp_ns for x in image_set.images]
            assert max(found) - min(found) <= tolerance * PERIOD_NS, "mixes instants"
            assert image_set.stamp_ns == min(found)
            assert min(found) > end_ns, "out of order"
            end_ns = max(found)
            assert len(found) >= (min_cameras or len(CAMERAS))
            assert list(image_set.cameras) == [c for c in CAMERAS if c in image_set.cameras]
            used += [(x.camera, x.stamp_ns) for x in image_set.images]
        assert len(set(used)) == len(used), "an image is used twice"
        assert_accounts(sync, number)
    sync.flush()
    assert_accounts(sync, len(puts))
    assert all(counts["waiting"] == 0 for counts in sync.counters.values())


@settings(max_examples=100, deadline=None)
@given(any_order, st.integers(0, 3))
def test_the_same_images_give_the_same_sets(puts, min_cameras):
    first, second = synchronizer(min_cameras), synchronizer(min_cameras)
    assert summary(run(first, puts)) == summary(run(second, puts))
    assert first.counters == second.counters


@settings(max_examples=100, deadline=None)
@given(st.data(), st.integers(0, 3), st.integers(1, 20))
def test_a_healthy_rig_loses_nothing(data, min_cameras, n):
    """Stamps that jitter within the tolerance, delivered in any interleaving with less lag than the queue."""
    jitter = st.integers(-TOLERANCE_NS // 2, TOLERANCE_NS // 2)
    puts = [(c, (i + 1) * PERIOD_NS + data.draw(jitter)) for i in range(n) for c in CAMERAS]
    lag = {c: data.draw(st.integers(0, 4)) * PERIOD_NS for c in CAMERAS}
    puts.sort(key=lambda put: (put[1] + lag[put[0]], put[0]))
    sync = synchronizer(min_cameras)
    sets = run(sync, puts)
    assert [len(image_set.images) for image_set in sets] == [3] * n
    assert (sync.sets_complete, sync.sets_incomplete) == (n, 0)


@settings(max_examples=100, deadline=None)
@given(st.data(), st.integers(1, 3))
def test_missing_images_never_stall_the_rest(data, min_cameras):
    """Whatever is missing, nothing waits longer than the queue, and every instant with enough images comes out."""
    n, queue = 40, 5
    present = [[data.draw(st.booleans()) for _ in range(n)] for _ in CAMERAS]
    puts = [(c, i * PERIOD_NS) for i in range(n) for k, c in enumerate(CAMERAS) if present[k][i]]
    sync = synchronizer(min_cameras, queue_s=queue * PERIOD_NS * 1e-9)
    sets = []
    for camera, stamp in puts:
        sets += sync.add(image(camera, stamp))
        assert sum(c["waiting"] for c in sync.counters.values()) <= (queue + 2) * len(CAMERAS)
    sets += sync.flush()
    wanted = [i * PERIOD_NS for i in range(n) if sum(row[i] for row in present) >= min_cameras]
    assert [image_set.stamp_ns for image_set in sets] == wanted
    n_seen = sum(any(row[i] for row in present) for i in range(n))
    assert len(sets) + sum(sync.sets_not_formed.values()) == n_seen


def test_a_camera_that_resumes_first_after_a_gap_is_not_taken_for_a_wrong_clock():
    """All pause for longer than the queue; images of before the gap still come from two cameras after the third has resumed."""
    sync = synchronizer(min_cameras=1, queue_s=5 * PERIOD_NS * 1e-9)
    resumed = 500
    puts = [(c, i * PERIOD_NS) for i in range(10) for c in CAMERAS if c == "left" or i < 7]
    delayed = [(c, i * PERIOD_NS) for i in range(7, 10) for c in ("middle", "right")]
    after = [(c, (resumed + i) * PERIOD_NS) for i in range(8) for c in CAMERAS]
    sets = run(sync, [*puts, after[0], *delayed, *after[1:]])
    stamps_s = {image_set.stamp_ns // PERIOD_NS for image_set in sets}
    assert set(range(resumed, resumed + 8)) <= stamps_s
    assert sync.sets_not_formed["ahead"] == 0


def test_sets_not_formed_are_counted_by_reason():
    sync = synchronizer(min_cameras=3)
    run(sync, [(c, i * PERIOD_NS) for i in range(6) for c in CAMERAS if (c, i) not in (("left", 2), ("right", 2), ("left", 4))])
    assert sync.sets_not_formed == {**dict.fromkeys(SET_REASONS, 0), "incomplete": 2}
    assert [c["incomplete"] for c in sync.counters.values()] == [0, 2, 1]
    sync = synchronizer(min_cameras=1, cameras=("left", "right"))
    run(sync, [(c, i * PERIOD_NS) for i in (0, 3, 1) for c in ("left", "right")])
    assert sync.sets_not_formed["late"] == 1  # both images of one instant
    sync = synchronizer()
    run(sync, [("left", 10**12), ("right", 10**12), ("left", 10**12 + PERIOD_NS)], flush=False)
    sync.reset()
    assert sync.sets_not_formed["reset"] == 2
    run(sync, [("left", 10**12), ("right", 10**12), ("left", 0)], flush=False)
    assert sync.sets_not_formed["clock_jump"] == 1 and sync.clock_jumps == 1
    wrong = synchronizer(min_cameras=1, cameras=(*CAMERAS, "wrong"))
    puts = [(c, i * PERIOD_NS + (10**12 if c == "wrong" else 0)) for i in range(40) for c in (*CAMERAS, "wrong")]
    run(wrong, puts, flush=False)
    assert wrong.sets_not_formed["ahead"] == wrong.counters["wrong"]["ahead"] >= 25
    assert (wrong.sets_complete, wrong.sets_incomplete) == (0, 40)


def test_a_stray_image_beside_a_set_is_no_instant_without_one():
    sync = synchronizer(min_cameras=2, cameras=("a", "b", "c", "d"))
    ms = 1_000_000
    run(sync, [("a", 20 * ms), ("b", 25 * ms), ("c", 29 * ms), ("d", 30 * ms), *((c, 60 * ms) for c in "abcd")])
    assert sum(sync.sets_not_formed.values()) == 0


def test_exact_stamps_only():
    sync = synchronizer(tolerance=0.0)
    sets = run(sync, [("left", 0), ("middle", 0), ("right", 1), ("left", 9), ("middle", 9), ("right", 9)])
    assert summary(sets) == [(("left", 9), ("middle", 9), ("right", 9))]
    assert [c["incomplete"] for c in sync.counters.values()] == [1, 1, 1]


def test_a_camera_that_stops_is_waited_for_once():
    sync = synchronizer(min_cameras=2, queue_s=5 * PERIOD_NS * 1e-9)
    alive = [(c, i * PERIOD_NS) for i in range(30) for c in CAMERAS if c != "right" or i < 10]
    latency = []
    for camera, stamp in alive:
        for image_set in sync.add(image(camera, stamp)):
            latency.append((stamp - image_set.stamp_ns) // PERIOD_NS)
    assert len(latency) == 30
    assert max(latency) <= 6  # the queue, once
    assert latency[-10:] == [0] * 10


def test_a_camera_that_stops_ends_complete_sets():
    sync = synchronizer(min_cameras=0, queue_s=5 * PERIOD_NS * 1e-9)
    sets = run(sync, [(c, i * PERIOD_NS) for i in range(30) for c in CAMERAS if c != "right" or i < 10])
    assert len(sets) == 10
    assert sync.counters["left"]["incomplete"] + sync.counters["left"]["too_old"] == 20


def test_a_lost_image_costs_one_period():
    sync = synchronizer(min_cameras=2)
    puts = [(c, i * PERIOD_NS) for i in range(3) for c in CAMERAS if (c, i) != ("middle", 1)]
    assert summary(run(sync, puts, flush=False))[1] == (("left", PERIOD_NS), ("right", PERIOD_NS))


def test_a_camera_whose_images_overtake_each_other_is_waited_for_once_that_is_known():
    """Every tenth image of one camera comes after the next two."""
    sync = synchronizer(min_cameras=2)
    puts = [(c, i * PERIOD_NS, i + (2.5 if c == "right" and i % 10 == 9 else 0.0)) for i in range(100) for c in CAMERAS]
    sets = run(sync, [(c, stamp) for c, stamp, _ in sorted(puts, key=lambda put: put[2])])
    assert [len(image_set.images) for image_set in sets] == [2 if i == 9 else 3 for i in range(100)]
    assert sync.counters["right"]["late"] == 1


def test_a_recording_that_loops_loses_nothing():
    sync = synchronizer()
    once = [(c, i * PERIOD_NS) for i in range(40) for c in CAMERAS]
    sets = run(sync, once + once)
    assert len(sets) == 80
    assert sync.clock_jumps == 1


def test_images_of_before_a_loop_that_come_late_are_dropped():
    sync = synchronizer(cameras=("left", "right"))
    puts = [(c, i * PERIOD_NS) for i in range(40) for c in ("left", "right")]
    last, puts = puts[-1], puts[:-1]
    sets = run(sync, [*puts, ("left", 0), last, ("right", 0)])
    assert summary(sets)[-1] == (("left", 0), ("right", 0))
    assert sync.counters["right"]["clock_jump"] == 1


def test_a_pause_of_all_cameras_is_no_timeout():
    puts = [(c, i * PERIOD_NS + (10**10 if i > 4 else 0)) for i in range(10) for c in CAMERAS]
    assert len(run(synchronizer(), puts)) == 10


@pytest.mark.parametrize("offset_ns", [10**15, -(10**15)])
def test_a_camera_with_a_wrong_clock_does_not_take_the_others_along(offset_ns):
    cameras = (*CAMERAS, "wrong")
    for min_cameras in (1, 3):
        sync = synchronizer(min_cameras, cameras=cameras)
        puts = [(c, 2 * 10**15 + i * PERIOD_NS + (offset_ns if c == "wrong" else 0)) for i in range(100) for c in cameras]
        good = [s for s in summary(run(sync, puts, flush=False)) if len(s) == 3]
        assert len(good) >= 98
        assert sync.counters["wrong"]["waiting"] <= 12


def test_a_camera_that_lags_beyond_the_queue_delays_nothing():
    sync = synchronizer(min_cameras=3, cameras=(*CAMERAS, "wrong"))
    latency = []
    for i in range(60):
        for camera in (*CAMERAS, "wrong"):
            stamp = 10**15 + i * PERIOD_NS - (10**12 if camera == "wrong" else 0)
            latency += [10**15 + i * PERIOD_NS - s.stamp_ns for s in sync.add(image(camera, stamp))]
    assert len(latency) >= 58
    assert max(latency[2:]) <= PERIOD_NS


def test_a_stray_image_does_not_break_up_its_neighbors():
    """Of two ways to group, the one with more cameras wins."""
    sync = synchronizer(min_cameras=2, cameras=("a", "b", "c", "d"))
    ms = 1_000_000
    stray = [("a", 20 * ms), ("b", 25 * ms), ("c", 29 * ms), ("d", 30 * ms)]  # 8 ms are tolerated: a-b or b-c-d
    sets = summary(run(sync, [*stray, *((c, 60 * ms) for c in "abcd")]))
    assert sets[0] == (("b", 25 * ms), ("c", 29 * ms), ("d", 30 * ms))
    assert len(sets[1]) == 4
    assert sync.counters["a"]["incomplete"] == 1


def test_surplus_images_of_one_instant():
    sync = synchronizer(cameras=("left", "right"))
    sets = run(sync, [("left", 0), ("left", 1), ("left", 1), ("right", 2), ("right", 2), ("right", 1)])
    assert summary(sets) == [(("left", 0), ("right", 2))]
    assert sync.counters["left"] == {**dict.fromkeys(REASONS, 0), "received": 3, "used": 1, "duplicate": 2, "waiting": 0}
    assert sync.counters["right"]["duplicate"] == 1
    assert sync.counters["right"]["late"] == 1


def test_reset_forgets_time_but_not_counters():
    sync = synchronizer()
    run(sync, [("left", 10**12), ("right", 10**12)], flush=False)
    sync.reset()
    assert sync.counters["left"]["reset"] == 1
    assert len(run(sync, [(c, 5) for c in CAMERAS])) == 1


def test_misuse_is_named():
    with pytest.raises(UnknownNameError, match=r"unknown camera 'top'; valid: left, middle, right"):
        synchronizer().add(image("top", 0))
    with pytest.raises(ValueError, match=r"min_cameras in \[0, 3\], got 4"):
        synchronizer(min_cameras=4)
    with pytest.raises(ValueError, match="unique camera names"):
        synchronizer(cameras=("a", "a"))
    with pytest.raises(ValueError, match="image_period_s > 0"):
        ImageSynchronizer(CAMERAS, image_period_s=0.0, tolerance=0.4, queue_s=1.0)


def decided(sync, puts):
    """Of each set, in periods: which image decided it, and its stamps by camera."""
    found = []
    for camera, periods in puts:
        for one in sync.add(image(camera, round(periods * PERIOD_NS))):
            found.append(((camera, periods), {x.camera: x.stamp_ns / PERIOD_NS for x in one.images}))
    return found


def two(min_cameras=0, queue=5):
    return synchronizer(min_cameras, queue_s=queue * PERIOD_NS * 1e-9, cameras=("left", "right"))


@pytest.mark.parametrize(("queue", "back"), [(5, 5), (0, 1)])
def test_stamps_jump_when_they_go_back_by_more_than_the_queue_and_a_period(queue, back):
    for more_ns, jumps in ((0, 0), (1, 1)):
        sync = two(queue=queue)
        run(sync, [("left", 10**12), ("left", 10**12 - back * PERIOD_NS - more_ns)], flush=False)
        assert sync.clock_jumps == jumps


def test_the_tolerance_and_the_end_of_a_set_belong_to_it():
    sync = two()
    assert summary(run(sync, [("left", 0), ("right", TOLERANCE_NS)], flush=False)) == [(("left", 0), ("right", TOLERANCE_NS))]
    run(sync, [("left", TOLERANCE_NS), ("left", TOLERANCE_NS + 1)], flush=False)
    assert (sync.counters["left"]["late"], sync.counters["left"]["waiting"]) == (1, 1)
    apart = two()
    assert run(apart, [("left", 0), ("right", TOLERANCE_NS + 1)], flush=False) == []
    assert [c["incomplete"] for c in apart.counters.values()] == [1, 0]  # whoever has sent later will not send it any more


def test_a_camera_is_waited_for_until_it_has_sent_something_later():
    puts = [("left", 0), ("middle", 0), ("right", 0), ("left", 1), ("middle", 1), ("left", 2), ("middle", 2), ("right", 2)]
    everybody = {"left": 2.0, "middle": 2.0, "right": 2.0}
    assert decided(synchronizer(min_cameras=2), puts)[1:] == [
        (("right", 2), {"left": 1.0, "middle": 1.0}), (("right", 2), everybody),
    ]  # fmt: skip


def test_a_silent_camera_is_waited_for_as_long_as_the_queue_once():
    """Its last image was the ninth: as the fifteenth of another comes, it has been silent for more than five periods."""
    sync = synchronizer(min_cameras=2, queue_s=5 * PERIOD_NS * 1e-9)
    found = decided(sync, [(c, i) for i in range(20) for c in CAMERAS if c != "right" or i < 10])
    assert [(which, min(stamps.values())) for which, stamps in found[10:]] == [
        *((("left", 15), float(i)) for i in range(10, 15)), *((("middle", i), float(i)) for i in range(15, 20)),
    ]  # fmt: skip


def test_what_all_are_needed_for_waits_as_long_as_the_queue_each_time():
    sync = synchronizer(min_cameras=3, queue_s=5 * PERIOD_NS * 1e-9)
    puts = [(c, i) for i in range(30) for c in CAMERAS if c != "right" or i < 10]
    assert len(decided(sync, puts)) == 10
    assert sync.counters["left"]["too_old"] == sync.counters["middle"]["too_old"] == 14  # those of 10 to 23
    assert sync.flush() == []
    assert sync.counters["left"]["incomplete"] == sync.counters["middle"]["incomplete"] == 6
    assert sync.sets_not_formed["too_old"] == 14 and sync.sets_not_formed["incomplete"] == 6


def test_a_camera_is_given_up_when_it_lags_by_more_than_the_queue():
    for lag, given_up in ((5.0, []), (5.1, [17.0])):
        found = decided(two(min_cameras=1), [("left", 10), ("right", 10), ("left", 17), ("right", 17 - lag)])
        assert [min(stamps.values()) for _, stamps in found] == [10.0, 17.0 - lag, *given_up]


def test_how_far_images_overtake_each_other_is_remembered_and_slowly_forgotten():
    puts = [(c, i) for i in range(6) for c in ("left", "right")]
    puts += [("left", 6), ("right", 8), ("right", 6), ("right", 7), ("left", 7), ("left", 8)]  # overtaken by two periods
    puts += [(c, i) for i in range(9, 14) for c in ("left", "right") if (c, i) != ("right", 9)]
    late = {min(stamps.values()): which for which, stamps in decided(two(min_cameras=1, queue=8), puts)}
    assert late[8.0] == ("left", 8) and late[9.0] == ("right", 12)  # not before 9 + 2 and the tolerance
    calm = [*puts, *((c, i) for i in range(14, 400) for c in ("left", "right")), ("left", 400), ("left", 401), ("right", 401)]
    assert dict((min(s.values()), w) for w, s in decided(two(min_cameras=1, queue=8), calm))[400.0] == ("right", 401)


def test_disorder_is_believed_up_to_the_queue():
    sync = two(min_cameras=1, queue=2)
    puts = [("left", 0), ("right", 0), ("right", 4), ("right", 2), ("left", 4), ("left", 5), *(("right", i) for i in (6, 7, 8))]
    assert dict((min(s.values()), w) for w, s in decided(sync, puts))[5.0] == ("right", 8)


def test_images_of_the_old_clock_are_dropped_for_as_long_as_the_queue():
    sync = two()
    run(sync, [(c, 10**12) for c in ("left", "right")], flush=False)
    run(sync, [("left", 0), *(("right", 10**12 + i * PERIOD_NS) for i in range(1, 9))], flush=False)
    assert sync.clock_jumps == 1
    assert sync.counters["right"]["clock_jump"] == 5 and sync.counters["left"]["clock_jump"] == 0


def test_a_camera_that_has_jumped_itself_is_on_the_new_clock():
    sync = two(min_cameras=1)
    run(sync, [(c, 10**12) for c in ("left", "right")], flush=False)
    run(sync, [("left", 0), ("right", 0), ("right", 10**12)], flush=False)
    assert sync.clock_jumps == 1 and sync.counters["right"]["clock_jump"] == 0
    assert sync.counters["right"]["received"] == 3


def test_after_a_reset_the_same_stamps_are_new_ones():
    sync = two()
    run(sync, [("left", 7), ("right", 7), ("left", PERIOD_NS)], flush=False)
    sync.reset()
    assert summary(run(sync, [("left", 7), ("right", 7)])) == [(("left", 7), ("right", 7))]
    assert all(c["duplicate"] == c["late"] == 0 for c in sync.counters.values()) and sync.sets_complete == 2


def test_what_comes_long_before_the_others_waits_for_them_until_its_time_is_up():
    """Two of three send from far before an image that is alone enough: they are decided first, and it after them or never."""
    def puts(n):
        return [("right", 100), *((c, i) for i in range(n) for c in ("left", "middle"))]

    sync = synchronizer(min_cameras=1, queue_s=5 * PERIOD_NS * 1e-9)
    found = decided(sync, puts(4))
    assert [min(s.values()) for _, s in found] == [0.0, 1.0, 2.0, 3.0] and sync.counters["right"]["waiting"] == 1
    assert sync.flush() == [] and sync.counters["right"]["ahead"] == 1
    later = synchronizer(min_cameras=1, queue_s=5 * PERIOD_NS * 1e-9)
    decided(later, puts(6))
    assert later.counters["right"]["waiting"] == 1
    decided(later, [("left", 6), ("middle", 6), ("left", 7)])
    assert later.counters["right"]["ahead"] == 1 and later.sets_not_formed["ahead"] == 1


@pytest.mark.parametrize("changes", [{"tolerance": 1.0}, {"tolerance": -0.1}, {"queue_s": -1e-3}, {"min_cameras": -1}])
def test_numbers_out_of_range_are_refused(changes):
    with pytest.raises(ValueError, match="expected"):
        synchronizer(**changes)
    synchronizer(**{"tolerance": 0.0, "queue_s": 0.0, "min_cameras": 3})
    with pytest.raises(ValueError, match="unique camera names"):
        synchronizer(cameras=())


def test_after_a_jump_images_within_the_queue_are_of_the_new_clock():
    sync = two()
    run(sync, [(c, 10**12) for c in ("left", "right")], flush=False)
    run(sync, [("left", 0), ("right", 5 * PERIOD_NS)], flush=False)
    assert sync.counters["right"]["clock_jump"] == 0 and sync.counters["right"]["waiting"] == 1


def test_the_last_images_of_a_recording_that_nobody_has_followed_are_a_set():
    """The others may have paused: only what they have sent since would say that this camera's clock is wrong."""
    sync = synchronizer(min_cameras=1, queue_s=5 * PERIOD_NS * 1e-9)
    sets = run(sync, [*((c, i * PERIOD_NS) for i in range(3) for c in CAMERAS), ("right", 100 * PERIOD_NS)])
    assert summary(sets)[-1] == (("right", 100 * PERIOD_NS),) and sync.counters["right"]["ahead"] == 0


def test_cameras_that_have_fallen_silent_hold_nobody_up():
    sync = synchronizer(min_cameras=1, queue_s=5 * PERIOD_NS * 1e-9)
    puts = [("right", 100), ("left", 0), ("middle", 0), *(("right", 100 + i) for i in range(1, 7))]
    found = decided(sync, puts)
    assert [(which, min(stamps.values())) for which, stamps in found] == [
        (("middle", 0), 0.0), *((("right", 106), 100.0 + i) for i in range(7)),
    ]  # fmt: skip
    assert sync.counters["right"]["ahead"] == 0


def test_an_image_at_the_very_end_of_a_set_is_a_duplicate():
    sync = two()
    sets = run(sync, [("left", 0), ("left", TOLERANCE_NS), ("right", TOLERANCE_NS)], flush=False)
    assert summary(sets) == [(("left", 0), ("right", TOLERANCE_NS))]
    assert (sync.counters["left"]["duplicate"], sync.counters["left"]["waiting"]) == (1, 0)


def test_a_clock_that_hardly_advances_does_not_fill_the_memory():
    """The others are silent, and by the only clock there is hardly any time passes."""
    sync = synchronizer()
    assert run(sync, [("left", n * 1000) for n in range(1000)], flush=False) == []
    counts = sync.counters["left"]
    assert counts["waiting"] <= 100 and counts["waiting"] + counts["too_old"] == counts["received"] == 1000
    assert sync.sets_not_formed["too_old"] > 0


QUAD = ("a", "b", "c", "d")
START = 100 * PERIOD_NS


def quad(**options):
    return synchronizer(**{"cameras": QUAD, "min_cameras": 2, "queue_s": 5 * PERIOD_NS * 1e-9, **options})


def good_sets(sync, wrong, n=40):
    """The sets of the cameras but ``a``, whose stamps ``wrong(i)`` replaces where it gives one."""
    puts = [(c, START + i * PERIOD_NS if c != "a" or wrong(i) is None else wrong(i)) for i in range(n) for c in QUAD]
    return run(sync, puts, flush=False)


@pytest.mark.parametrize("wrong", [lambda i: 1, lambda i: i * PERIOD_NS // 9, lambda i: i % 3])
def test_a_camera_that_goes_back_alone_is_left_out_and_the_others_go_on(wrong):
    sync = quad()
    sets = good_sets(sync, lambda i: wrong(i) if 10 <= i < 30 else None)
    assert [s.stamp_ns for s in sets] == [START + i * PERIOD_NS for i in range(40)]
    assert [len(s.images) for s in sets] == [4] * 10 + [3] * 20 + [4] * 10
    assert sync.clock_jumps == 0 and sync.counters["a"]["clock_jump"] == 20
    assert all(sync.counters[c]["used"] == 40 for c in "bcd")


def test_one_stray_stamp_costs_its_image():
    sync = quad()
    assert [len(s.images) for s in good_sets(sync, lambda i: 1 if i == 20 else None)] == [4] * 20 + [3] + [4] * 19
    assert sync.clock_jumps == 0 and sync.counters["a"]["clock_jump"] == 1


def test_a_camera_that_comes_back_from_a_clock_ahead_joins_the_others():
    sync = quad()
    sets = good_sets(sync, lambda i: START + 10**13 + i * PERIOD_NS if 10 <= i < 30 else None)
    assert [len(s.images) for s in sets] == [4] * 10 + [3] * 20 + [4] * 10
    assert sync.clock_jumps == 0 and sync.counters["a"]["incomplete"] + sync.counters["a"]["ahead"] == 20


def test_a_recording_whose_cameras_go_back_one_after_another_loses_nothing():
    sync = quad(min_cameras=0)
    once = [(c, START + i * PERIOD_NS) for i in range(20) for c in QUAD]
    first = [("a", START), ("a", START + PERIOD_NS)]
    sets = run(sync, [*once, *first, *(put for put in once if put not in first)])
    assert [s.stamp_ns for s in sets] == 2 * [START + i * PERIOD_NS for i in range(20)] and sync.clock_jumps == 1


def test_a_camera_that_goes_back_is_believed_once_the_others_are_silent():
    sync = quad(min_cameras=1)
    run(sync, [(c, START + i * PERIOD_NS) for i in range(9) for c in QUAD], flush=False)
    sets = run(sync, [("a", i * PERIOD_NS) for i in range(20)], flush=False)
    assert sync.clock_jumps == 1 and len(sets) >= 10 and all(s.stamp_ns < START for s in sets)


@pytest.mark.parametrize("rate_hz", [5, 10, 30, 60])
def test_a_camera_that_stops_is_waited_for_as_long_as_the_queue_at_any_rate(rate_hz):
    period_ns = 10**9 // rate_hz
    sync = ImageSynchronizer(QUAD, image_period_s=1 / 30, tolerance=0.4, queue_s=1.0, min_cameras=2)
    waits = []
    for i in range(6 * rate_hz):
        for camera in QUAD[: 4 if i < 2 * rate_hz else 3]:
            waits += [(i * period_ns - s.stamp_ns) * 1e-9 for s in sync.add(image(camera, i * period_ns))]
    assert 0.8 <= max(waits) <= 1.3 and len(waits) == 6 * rate_hz


@pytest.mark.parametrize("period_s", [2, 10, 60])
def test_slow_cameras_have_complete_sets(period_s):
    sync = ImageSynchronizer(QUAD, image_period_s=1 / 30, tolerance=0.4, queue_s=1.0, min_cameras=2)
    sets = run(sync, [(c, i * period_s * 10**9) for i in range(20) for c in QUAD], flush=False)
    assert [len(s.images) for s in sets] == [4] * 20
