"""Image sources: one contract for videos and folders, and what goes wrong with files."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.cameras.small_clip import CAMERAS
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig, CaptureSettings
from tracker_node.errors import CalibrationError, SourceError
from tracker_node.loaders.images.source import (
    PreloadedSource,
    SourceOptions,
    assumed_rate,
    list_images,
    load_backgrounds,
    open_camera_source,
    open_recordings,
    open_source,
    resized_backgrounds,
)

N, WIDTH, HEIGHT, RATE_HZ = 12, 64, 48, 25.0


def numbered_image(i: int) -> np.ndarray:
    """An image that says its number by its gray level, also after lossy coding."""
    return np.full((HEIGHT, WIDTH, 3), 10 + 20 * i, np.uint8)


def number_of(image: np.ndarray) -> int:
    return round((float(image.mean()) - 10) / 20)


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "video.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), RATE_HZ, (WIDTH, HEIGHT))
    for i in range(N):
        writer.write(numbered_image(i))
    writer.release()
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "images"
    path.mkdir()
    for i in range(N):
        cv2.imwrite(str(path / f"image{i}.png"), numbered_image(i))  # not padded: 10 sorts before 2 as text
    (path / "notes.txt").write_text("not an image")
    return path


@pytest.fixture(params=["video", "folder"])
def path(request: pytest.FixtureRequest) -> Path:
    return request.getfixturevalue(request.param)


def test_a_preloaded_source_tells_what_is_missing_in_each_pass(folder: Path):
    (folder / "image3.png").write_bytes(b"no picture")
    plain, preloaded = open_source(folder), PreloadedSource(open_source(folder))
    for _ in range(2):
        assert [number_of(image) for _, image in preloaded] == [number_of(image) for _, image in plain]
        assert (preloaded.counts.read, preloaded.counts.missing) == (N - 1, 1)
        assert preloaded.counts == plain.counts and len(plain.counts.problems) == 1


def test_all_images_in_order_with_integer_stamps(path: Path):
    source = open_source(path, rate_hz=30.0)
    assert (source.width, source.height, source.n_images) == (WIDTH, HEIGHT, N)
    stamps, images = zip(*source, strict=True)
    assert [number_of(image) for image in images] == list(range(N))
    assert stamps[:4] == (0, 33333333, 66666667, 100000000)  # rounded each, not summed
    assert all(type(stamp) is int for stamp in stamps)
    assert source.counts.read == N and source.counts.missing == 0


def test_second_pass_is_equal(path: Path):
    source = open_source(path)
    assert [stamp for stamp, _ in source] == [stamp for stamp, _ in source]


def test_part_keeps_the_stamps_of_the_whole(path: Path):
    whole = dict(open_source(path, rate_hz=25.0))
    part = list(open_source(path, rate_hz=25.0, start=3, end=7))
    assert [number_of(image) for _, image in part] == [3, 4, 5, 6]
    for stamp, image in part:
        assert np.array_equal(whole[stamp], image)


def test_loop_goes_on_counting(path: Path):
    source = open_source(path, rate_hz=25.0, start=8, loop=True)
    taken = list(itertools.islice(source, 9))
    assert [number_of(image) for _, image in taken] == [8, 9, 10, 11, 8, 9, 10, 11, 8]
    assert [stamp for stamp, _ in taken] == [40_000_000 * i for i in range(8, 17)]


def test_resize(path: Path):
    source = open_source(path, size=(32, 24))
    assert (source.width, source.height) == (32, 24)
    assert next(iter(source))[1].shape == (24, 32, 3)


def test_preloaded_is_the_same(path: Path):
    options = {"start": 2, "end": 6, "rate_hz": 25.0, "size": (32, 24), "loop": True}
    direct, preloaded = open_source(path, **options), PreloadedSource(open_source(path, **options))
    assert (preloaded.width, preloaded.height, preloaded.n_images) == (32, 24, 4)
    pairs = list(zip(itertools.islice(direct, 9), itertools.islice(preloaded, 9), strict=True))
    assert all(a[0] == b[0] and np.array_equal(a[1], b[1]) for a, b in pairs)


def test_video_states_its_rate(video: Path):
    assert open_source(video).rate_hz == RATE_HZ


def test_patterns(folder: Path):
    assert len(list_images(str(folder / "image?.png"))) == 10
    assert len(list_images(str(folder / "image%d.png"))) == N
    assert open_source(folder / "image1*.png").n_images == 3
    assert open_source(folder / "image7.png").n_images == 1


@pytest.mark.parametrize("name", ["absent.mp4", "absent/*.png"])
def test_missing_is_named(tmp_path: Path, name: str):
    with pytest.raises(SourceError, match="absent"):
        open_source(tmp_path / name)


def test_unreadable_is_named(tmp_path: Path):
    path = tmp_path / "noise.mp4"
    path.write_bytes(b"this is no video" * 100)
    with pytest.raises(SourceError, match=r"noise\.mp4"):
        open_source(path)


def test_empty_folder(tmp_path: Path):
    with pytest.raises(SourceError, match="no image files"):
        open_source(tmp_path)


def test_start_beyond_the_end(video: Path):
    with pytest.raises(SourceError, match="only 12 images"):
        open_source(video, start=12)


def test_truncated_video_ends_with_a_count(shared_data: Path, tmp_path: Path):
    whole = (shared_data / "pose2sim_balancing/videos/cam01.mp4").read_bytes()
    index_first = whole.find(b"moov") < whole.find(b"mdat")
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(whole[: len(whole) // 2])
    if not index_first:  # without its index the file cannot be opened at all
        with pytest.raises(SourceError, match=r"cut\.mp4"):
            open_source(cut)
        return
    source = open_source(cut)
    n = sum(1 for _ in source)
    assert 0 < n < 100 and source.counts.read == n and source.counts.missing == 100 - n
    assert f"ends after {n}" in source.counts.problems[0]


def test_truncated_avi_ends_with_a_count(tmp_path: Path):
    path = tmp_path / "long.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), RATE_HZ, (320, 240))
    noise = np.random.default_rng(0)
    for _ in range(40):
        writer.write(noise.integers(0, 255, (240, 320, 3), dtype=np.uint8))
    writer.release()
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * 0.6)])
    source = open_source(path)
    n = sum(1 for _ in source)
    assert 0 < n < 40 and source.counts.read == n


def test_unreadable_image_of_a_folder_is_counted_and_the_rest_delivered(folder: Path):
    (folder / "image5.png").write_bytes(b"damaged")
    source = open_source(folder, rate_hz=25.0)
    images = list(source)
    assert [number_of(image) for _, image in images] == [i for i in range(N) if i != 5]
    assert images[5][0] == 6 * 40_000_000  # the stamps of the others stay
    assert source.counts.missing == 1 and "image5.png" in source.counts.problems[0]


@pytest.mark.parametrize("preload", [False, True])
def test_an_image_of_another_size_is_counted_and_the_rest_delivered(folder: Path, preload: bool):
    """It ended the camera, and the message named an image that was damaged before, if there was one."""
    cv2.imwrite(str(folder / "image5.png"), np.zeros((HEIGHT // 2, WIDTH // 2, 3), np.uint8))
    source = open_source(folder, rate_hz=25.0)
    source = PreloadedSource(source) if preload else source
    assert [stamp // 40_000_000 for stamp, _ in source] == [i for i in range(N) if i != 5]
    assert (source.counts.read, source.counts.unusable, source.counts.missing) == (N - 1, 1, 0)
    assert source.counts.problems == [f"{folder / 'image5.png'} is of {WIDTH // 2}x{HEIGHT // 2} pixels, not {WIDTH}x{HEIGHT}"]


def rewritten(folder: Path, name: str, numbers: list[int]) -> Path:
    """A folder in which file ``i`` has the ``i``-th of these numbers in its name."""
    other = folder.parent / "others"
    other.mkdir()
    for i, number in enumerate(numbers):
        (folder / f"image{i}.png").rename(other / name.format(number))
    return other


@pytest.mark.parametrize(
    ("name", "numbers", "gaps"),
    [
        ("image{}.png", [7, 8, 10, 11, 12], [2]),
        ("cam2_{:04d}_left.png", [0, 1, 2, 6, 7], [3, 4, 5]),
        ("{:03d}.png", [0, 10, 20, 40, 50], [3]),
        ("{:02d}.png", [0, 1, 3], [2]),
        ("{}.png", [0, 10, 20, 30], []),  # a common step
        ("{}.png", [5, 6, 7, 8], []),
        ("{}.png", [1700000000000000000, 1700000000033301111, 1700000000066654321, 1700000000100012345], []),  # times
        ("{}.png", [3, 17, 41, 50, 72], []),  # chosen by hand
        ("{}.png", [0, 1, 2, 1_000_000], []),
    ],
)
def test_a_missing_number_of_a_folder_is_a_missing_image(folder: Path, name: str, numbers: list[int], gaps: list[int]):
    other = rewritten(folder, name, numbers)
    source = open_source(other, rate_hz=25.0)
    there = [i for i in range(len(numbers) + len(gaps)) if i not in gaps]
    assert (source.n_images, source.n_stored) == (len(numbers) + len(gaps), len(numbers))
    for _ in range(2):
        read = list(source)
        assert [stamp for stamp, _ in read] == [40_000_000 * i for i in there]
        assert [number_of(image) for _, image in read] == list(range(len(numbers)))
        assert source.counts.missing == len(gaps) and source.counts.problems == []
    first = name.format(numbers[0] + gaps[0] * (numbers[1] - numbers[0])) if gaps else ""
    told = f"{len(gaps)} of {len(gaps) + len(numbers)} numbered images are missing, first {first}"
    assert source.note == (told if gaps else "")


def test_a_rate_is_assumed_where_nothing_says_it(folder: Path, video: Path):
    assert assumed_rate([open_source(video), open_source(folder)], "--rate") == [
        "no rate in image folders: 30 Hz assumed; --rate says another"
    ]
    times = tuple(range(N))
    said = [open_source(video), open_source(folder, rate_hz=30.0), open_source(folder, times_ns=times)]
    assert assumed_rate([*said, open_source(folder / "image1.png")], "--rate") == []


def test_parts_and_loops_of_a_folder_with_a_gap_go_by_the_numbers(folder: Path):
    (folder / "image3.png").unlink()
    part = open_source(folder, rate_hz=25.0, start=2, end=5)
    assert [(stamp // 40_000_000, number_of(image)) for stamp, image in part] == [(2, 2), (4, 4)]
    loop = itertools.islice(open_source(folder, rate_hz=25.0, start=2, end=5, loop=True), 4)
    assert [(stamp // 40_000_000, number_of(image)) for stamp, image in loop] == [(2, 2), (4, 4), (5, 2), (7, 4)]
    assert open_source(folder / "image%d.png").counts.missing == 0 and open_source(folder / "image%d.png").n_images == N


def test_a_time_for_each_file_says_more_than_its_number(folder: Path, tmp_path: Path):
    (folder / "image3.png").unlink()
    stamps = tmp_path / "stamps.csv"
    stamps.write_text("\n".join(["time", *(f"{0.04 * i:.2f}" for i in range(N) if i != 3)]))
    K = np.array([[50.0, 0, 31.5], [0, 50.0, 23.5], [0, 0, 1]])
    camera = Camera("left", CameraModel(WIDTH, HEIGHT, K), np.eye(4), source=str(folder), stamp_file=str(stamps))
    for source in (open_camera_source(camera), *open_recordings({"left": str(folder)}, stamps).values()):
        assert [(stamp // 40_000_000, number_of(image)) for stamp, image in source] == [(i, i) for i in range(N) if i != 3]


@pytest.mark.parametrize("publish", ["color", "jpeg"])
def test_an_image_that_is_cut_off_is_as_one_that_cannot_be_read(tmp_path: Path, publish: str):
    noise = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    for i in range(5):
        cv2.imwrite(str(tmp_path / f"{i}.jpg"), noise)
    whole = (tmp_path / "0.jpg").read_bytes()
    thumbnail = b"\xff\xe1\x00\x06\xff\xd8\xff\xd9"
    (tmp_path / "1.jpg").write_bytes(whole[:2] + thumbnail + whole[2 : len(whole) // 2])
    (tmp_path / "2.jpg").write_bytes(whole[:2] + thumbnail + whole[2:] + bytes(5000))  # padded
    (tmp_path / "3.jpg").write_bytes(whole[:-1])
    source = open_source(tmp_path, capture=CaptureSettings(publish=publish))
    assert [round(stamp * 30e-9) for stamp in (image.stamp_ns for image in source.images())] == [0, 2, 4]
    assert [text.split(" is ")[0] for text in source.counts.problems] == [str(tmp_path / f"{i}.jpg") for i in (1, 3)]
    assert all("cut off" in text for text in source.counts.problems)


def test_a_camera_that_never_writes_the_end_of_an_image_is_read_all_the_same(tmp_path: Path):
    for i in range(5):
        cv2.imwrite(str(tmp_path / f"{i}.jpg"), np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
        (tmp_path / f"{i}.jpg").write_bytes((tmp_path / f"{i}.jpg").read_bytes()[:-2])
    assert len(list(open_source(tmp_path))) == 5


def test_a_png_that_is_cut_off_is_not_read(folder: Path):
    whole = (folder / "image0.png").read_bytes()
    (folder / "image0.png").write_bytes(whole[:-20])
    (folder / "image1.png").write_bytes(whole + bytes(100))
    source = open_source(folder)
    assert len(list(source)) == N - 1 and "image0.png is cut off" in source.counts.problems[0]


def test_camera_source_checks_the_calibration(video: Path):
    K = np.array([[50.0, 0, 31.5], [0, 50.0, 23.5], [0, 0, 1]])
    good = Camera("left", CameraModel(WIDTH, HEIGHT, K), np.eye(4), source=str(video), time_offset_ns=-7)
    assert next(iter(open_camera_source(good, SourceOptions(base_stamp_ns=1000))))[0] == 993
    bad = Camera("left", CameraModel(WIDTH, HEIGHT + 1, K), np.eye(4), source=str(video))
    with pytest.raises(CalibrationError, match=r"'left'.*expected 64x49, got 64x48"):
        open_camera_source(bad)
    with pytest.raises(SourceError, match="left"):
        open_camera_source(Camera("left", CameraModel(WIDTH, HEIGHT, K), np.eye(4)))


def test_real_video(shared_data: Path):
    source = open_source(shared_data / "pose2sim_balancing/videos/cam01.mp4", end=2)
    stamps = [stamp for stamp, _ in source]
    assert source.rate_hz == pytest.approx(60.0) and stamps == [0, 16666667]
    assert (source.width, source.height) == (1080, 1920)


def test_images_whose_time_is_over_are_left_out_and_counted(path: Path):
    """From the third image on those before the ninth are not wanted: at most four in a row are left out."""
    source = open_source(path, rate_hz=25.0)
    got = []
    for stamp, image in source:
        got.append(number_of(image))
        if stamp == 80_000_000:
            source.skip_before(8 * 40_000_000)
    assert got == [0, 1, 2, 7, 8, 9, 10, 11]
    assert (source.counts.read, source.counts.skipped) == (8, 4)
    assert [number_of(image) for _, image in source] == list(range(N))  # the next pass has all of them


def test_none_of_them_is_read_where_that_is_asked_for(path: Path):
    source, got = open_source(path, rate_hz=25.0), []
    for _, image in source:
        got.append(number_of(image))
        source.skip_before(9 * 40_000_000, math.inf)
    assert got == [0, 9, 10, 11]
    assert source.counts.skipped == 8


LENS = CameraModel(40, 30, np.array([[40.0, 0.0, 19.5], [0.0, 40.0, 14.5], [0.0, 0.0, 1.0]]))


def rig_with_background(path: Path | None) -> CameraRig:
    first, second = list(CAMERAS)[:2]
    with_one = Camera(first, LENS, np.eye(4), background=None if path is None else str(path))
    return CameraRig((with_one, Camera(second, LENS, np.eye(4))))


def test_only_cameras_with_a_background_have_one(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "background.png"), pixels)
    backgrounds = load_backgrounds(rig_with_background(tmp_path / "background.png"))
    assert list(backgrounds) == ["cam01"]
    assert (backgrounds["cam01"] == pixels).all()
    assert load_backgrounds(rig_with_background(None)) == {}


def test_backgrounds_follow_the_size_of_the_images(tmp_path: Path) -> None:
    rig = rig_with_background(tmp_path / "background.png")
    cv2.imwrite(str(tmp_path / "background.png"), np.full((30, 40, 3), 7, np.uint8))
    smaller = CameraRig(tuple(replace(camera, model=camera.model.resized(20, 15)) for camera in rig))
    backgrounds = load_backgrounds(rig)
    assert resized_backgrounds(backgrounds, smaller)["cam01"].shape == (15, 20, 3)
    assert (resized_backgrounds(backgrounds, rig)["cam01"] == backgrounds["cam01"]).all()


def test_unusable_backgrounds_are_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"gone\.png.*cam01"):
        load_backgrounds(rig_with_background(tmp_path / "gone.png"))
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((3, 4, 3), np.uint8))
    with pytest.raises(CalibrationError, match=r"cam01.*expected 40x30, got 4x3"):
        load_backgrounds(rig_with_background(tmp_path / "small.png"))


def test_a_recording_of_each_camera_with_the_times_of_one_file(folder: Path, video: Path, tmp_path: Path) -> None:
    opened = open_recordings({"a": str(folder), "b": str(video)})
    assert {name: source.n_images for name, source in opened.items()} == {"a": N, "b": N}
    stamps = tmp_path / "stamps.csv"
    stamps.write_text("\n".join(["time", *(f"{5 + 0.1 * i:.1f}" for i in range(N))]))
    assert [source.stamp_ns(1) for source in open_recordings({"a": str(folder)}, stamps).values()] == [5_100_000_000]
    stamps.write_text("time\n5.0\n5.1\n")
    with pytest.raises(SourceError, match=f"has 2 times for camera 'a', but .* has {N} images"):
        open_recordings({"a": str(folder)}, stamps)
