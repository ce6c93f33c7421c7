"""What single cameras' recordings tell: each fault from both sides of where it begins."""

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.doctor.recording import CameraRecording, ViewShift
from tracker_node.doctor.video import rate_problems, size_problems, source_problems, video_problems

N, PERIOD_NS = 20, 100_000_000


def recording(n=N, name="cam", levels=None, size=(400, 300), **kept):
    """Images of one even gray each; ``levels`` (n,), 100 by default."""
    result = CameraRecording(name, n, 10.0)
    result.size = size
    result.stamps_ns = [5_000_000_000 + i * PERIOD_NS for i in range(n)]
    result.small = [np.full((30, 40), 100 if levels is None else levels[i], np.uint8) for i in range(n)]
    result.changes = [float("nan"), *[2.0] * (n - 1)][:n]
    for key, value in kept.items():
        setattr(result, key, value)
    return result


def camera(cx=199.5, cy=149.5, size=(400, 300)):
    K = np.array([[350.0, 0.0, cx], [0.0, 350.0, cy], [0.0, 0.0, 1.0]])
    return Camera("cam", CameraModel(*size, K), np.eye(4))


def found(recording, others=()):
    findings, good = video_problems(recording, [recording, *others])
    return {finding.fault: finding for finding in findings}, good


def test_a_sound_recording_gives_no_finding():
    findings, good = found(recording())
    assert findings == {}
    assert good.all()
    assert source_problems(recording()) == []


def test_a_source_without_images_says_why():
    (finding,) = source_problems(recording(0))
    assert finding.sentence == "cam: no images: its source holds no images."
    (finding,) = source_problems(recording(0, problems=["a", "b"]))
    assert finding.sentence == "cam: no images: a; b."
    assert [one.sentence for one in source_problems(recording(problems=["it broke"]))] == ["cam: after 20 images: it broke."]


def test_images_of_the_calibration_s_size():
    findings, sized = size_problems(camera(), recording())
    assert findings == []
    assert sized.model.width == 400


@pytest.mark.parametrize("size", [(800, 600), (200, 150), (398, 300), (404, 301)])
def test_images_that_were_made_larger_or_smaller(size):
    (finding,), sized = size_problems(camera(), recording(size=size))
    assert finding.fault == "resolution"
    assert finding.values == {"width": size[0], "height": size[1]}
    assert f"resampled by {size[0] / 400:g}" in finding.sentence
    assert (sized.model.width, sized.model.height) == size
    assert sized.model.K[0, 0] == pytest.approx(350.0 * size[0] / 400)


@pytest.mark.parametrize("size", [(400, 250), (500, 300), (300, 400), (405, 300)])
def test_images_that_were_cropped(size):
    (finding,), sized = size_problems(camera(), recording(size=size))
    assert "cropped" in finding.sentence
    assert sized is None


@pytest.mark.parametrize(
    ("cx", "cy", "sound"),
    [
        (122.0, 149.5, True), (117.0, 149.5, False), (277.0, 149.5, True), (282.0, 149.5, False), (199.5, 91.0, True),
        (199.5, 88.0, False),
    ],
)  # fmt: skip
def test_a_principal_point_by_a_fifth_of_the_image_off_is_of_another_size(cx, cy, sound):
    findings, sized = size_problems(camera(cx, cy), recording())
    assert (findings == []) == sound == (sized is not None)
    if findings:
        assert f"about {2 * cx:.0f}x{2 * cy:.0f}" in findings[0].sentence
        assert findings[0].values["principal_point_off"] == pytest.approx(max(abs(cx / 399 - 0.5), abs(cy / 299 - 0.5)))


def test_a_camera_that_was_moved():
    """By more than 0.4 % of 400 pixels, between the last look at the old place and the first at the new one."""
    shifts = [ViewShift(i, px) for i, px in ((3, 0.2), (6, 1.5), (9, 8.0), (12, 9.0), (15, 9.4))]
    findings, good = found(recording(view_shifts=shifts))
    assert findings["moved"].values == pytest.approx({"px": 9.4, "after_s": 0.6})
    assert "between 0.6 and 0.9 s: the background lies 9 px from" in findings["moved"].sentence
    assert good.tolist() == [True] * 7 + [False] * 13
    assert found(recording(view_shifts=[ViewShift(3, 9.0), ViewShift(6, 9.0), ViewShift(9, 1.5)]))[0] == {}  # it came back
    first = found(recording(view_shifts=[ViewShift(3, 9.0), ViewShift(6, 9.0)]))
    assert first[0]["moved"].values["after_s"] == 0.0
    assert first[1].sum() == 1


@pytest.mark.parametrize(
    ("copies", "n", "told"), [((7,), 20, True), ((7, 8), 20, True), ((7,), 99, False), ((7, 9, 30), 99, True)]
)
def test_images_that_are_there_twice(copies, n, told):
    changes = [float("nan"), *[2.0] * (n - 1)]
    for i in copies:
        changes[i] = 0.0
    findings, good = found(recording(n, changes=changes))
    assert ("repeated" in findings) == told
    assert np.flatnonzero(~good).tolist() == list(copies)
    if told:
        assert findings["repeated"].values["share"] == pytest.approx(len(copies) / (n - 1))
        assert f"{len(copies)} of {n} images" in findings["repeated"].sentence
        assert "(the first at 0.70 s)" in findings["repeated"].sentence


@pytest.mark.parametrize(("moves", "copies"), [(True, [7]), (False, [])])
def test_images_that_are_nearly_there_twice_count_where_another_camera_sees_motion(moves, copies):
    changes = [float("nan"), *[2.0] * (N - 1)]
    changes[7] = 0.2
    other = recording(name="other", changes=[float("nan"), *[2.0] * 6, 2.0 if moves else 0.5, *[2.0] * 12])
    assert np.flatnonzero(~found(recording(changes=changes), [other])[1]).tolist() == copies


@pytest.mark.parametrize(("level", "told"), [(107, False), (109, True), (92, True), (94, False)])
def test_brightness_that_changes(level, told):
    findings, _ = found(recording(levels=[100] * 12 + [level] * 8))
    assert ("exposure" in findings) == told
    if told:
        high, low = max(level, 100) + 1, min(level, 100) + 1
        assert findings["exposure"].values == pytest.approx({"change": high / low - 1, "at_s": 1.2})


def test_brightness_is_told_at_the_time_step_of_its_largest_change():
    levels = [100] * 5 + [103] * 5 + [120] * 5 + [118] * 5
    assert found(recording(levels=levels))[0]["exposure"].values["at_s"] == pytest.approx(1.0)


@pytest.mark.parametrize(("combs", "told"), [([0.9, 1.1, 1.2], True), ([0.9, 0.95, 1.2], False), ([], False)])
def test_combs_are_of_interlaced_video(combs, told):
    findings, _ = found(recording(combs=combs))
    assert ("interlaced" in findings) == told
    if told:
        assert findings["interlaced"].values["comb_ratio"] == pytest.approx(1.1)


def test_cameras_in_which_nothing_moves_say_nothing_of_the_rate():
    still = recording()
    assert rate_problems([still], {"cam": np.ones(N, bool)}) == []


def test_findings_name_their_fault_and_camera():
    told = [*source_problems(recording(0)), *source_problems(recording(problems=["it broke"]))]
    assert [(one.fault, one.cameras) for one in told] == [("source", ("cam",))] * 2
    assert size_problems(camera(), recording(size=(400, 250)))[0][0].cameras == ("cam",)


def test_brightness_is_of_the_images_that_can_be_used():
    """One repeated image before the change: the time step is that of the image, not of its place among those that are left."""
    changes = [float("nan"), *[2.0] * (N - 1)]
    changes[4] = 0.0
    findings, good = found(recording(levels=[100] * 12 + [120] * 8, changes=changes))
    assert not good[4]
    assert findings["exposure"].values["at_s"] == pytest.approx(1.2)
    assert "most at 1.2 s" in findings["exposure"].sentence
    assert "by 20 %" in findings["exposure"].sentence


def moving(step_px, jumps=False, n=N):
    """Small images of a bright textured square that goes to the right, or is elsewhere in every other image."""
    texture = np.kron(np.random.default_rng(1).integers(120, 255, (8, 8)), np.ones((4, 4)))
    images = []
    for i in range(n):
        image = np.full((160, 200), 60, np.uint8)
        u = round(10 + step_px * i) + (100 if jumps and i % 2 else 0)
        image[60:92, u : u + 32] = texture
        images.append(image)
    return images


def test_the_rate_is_too_low_where_things_are_elsewhere_in_every_image():
    slow, jumping = recording(small=moving(2)), recording(small=moving(2, jumps=True))
    usable = {"cam": np.ones(N, bool)}
    assert rate_problems([slow], usable) == []
    (finding,) = rate_problems([jumping], usable)
    assert (finding.fault, finding.cameras) == ("rate", ())
    assert finding.values["rate_hz"] == pytest.approx(10.0)
    assert finding.values["growth"] < 1.15
    assert "(10 Hz)" in finding.sentence
    still = recording(name="still")
    assert len(rate_problems([jumping, still], usable | {"still": np.ones(N, bool)})) == 1
