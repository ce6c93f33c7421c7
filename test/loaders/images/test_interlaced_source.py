"""Interlaced files: twice as many images, each of one instant; and files that are not what the rig says."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import FileFormatError, SourceError
from tracker_node.loaders.images.source import InterlacedSource, PreloadedSource, SourceOptions, open_camera_source
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.observation.deinterlace import weave_fields

WIDTH, HEIGHT, N = 96, 72, 5


def instant(k: int) -> np.ndarray:
    """A bright square before a soft slope; it moves by 4 pixels from instant to instant."""
    image = np.broadcast_to(np.linspace(20, 60, WIDTH, dtype=np.uint8)[None, :, None], (HEIGHT, WIDTH, 3)).copy()
    image[16:56, 5 + 4 * k : 45 + 4 * k] = 230
    return image


def left_edge(image: np.ndarray) -> int:
    return int(np.argmax(image[36, :, 0] > 150))


def write(folder: Path, images: list[np.ndarray]) -> Path:
    folder.mkdir()
    for j, image in enumerate(images):
        cv2.imwrite(str(folder / f"image{j}.png"), image)
    return folder


def woven(folder: Path, order: str = "top_first") -> Path:
    top, bottom = (0, 1) if order == "top_first" else (1, 0)
    pairs = [(instant(2 * j)[top::2], instant(2 * j + 1)[bottom::2]) for j in range(N)]
    return write(folder, [weave_fields(a, b, order) for a, b in pairs])


def camera(source: Path, order: str | None = "top_first") -> Camera:
    K = np.array([[80.0, 0.0, 47.5], [0.0, 80.0, 35.5], [0.0, 0.0, 1.0]])
    return Camera("left", CameraModel(WIDTH, HEIGHT, K), np.eye(4), str(source), interlaced=order)


@pytest.mark.parametrize("order", ["top_first", "bottom_first"])
def test_every_field_becomes_an_image_at_its_own_time(tmp_path, order):
    source = open_camera_source(camera(woven(tmp_path / "a", order), order), SourceOptions(rate_hz=50.0))
    stamps, images = zip(*source, strict=True)
    assert (source.n_images, source.width, source.height) == (2 * N, WIDTH, HEIGHT)
    assert stamps == tuple(20_000_000 * k for k in range(2 * N))
    assert [left_edge(image) for image in images] == [5 + 4 * k for k in range(2 * N)]
    assert all(image.shape == (HEIGHT, WIDTH, 3) for image in images)


def test_start_and_end_count_fields(tmp_path):
    source = InterlacedSource(woven(tmp_path / "a"), SourceOptions(start=3, end=6, rate_hz=50.0), "top_first")
    got = [(stamp // 20_000_000, left_edge(image)) for stamp, image in source]
    assert got == [(3, 17), (4, 21), (5, 25)] and source.n_images == 3
    assert [left_edge(image) for _, image in PreloadedSource(source)] == [17, 21, 25]


def test_the_rate_is_twice_that_of_the_file(tmp_path):
    assert InterlacedSource(woven(tmp_path / "a"), SourceOptions(), "top_first").rate_hz == 60.0  # folders: 30 images a second


@pytest.mark.parametrize("preload", [False, True])
def test_kept_originals_are_the_woven_images(tmp_path, preload):
    folder = woven(tmp_path / "a")
    source = InterlacedSource(folder, SourceOptions(keep=True), "top_first")
    images = list((PreloadedSource(source) if preload else source).images())
    for j, (first, second) in enumerate(zip(images[::2], images[1::2], strict=True)):
        np.testing.assert_array_equal(first.original, cv2.imread(str(folder / f"image{j}.png")))
        assert second.original is None
    assert all(image.original is None for image in InterlacedSource(folder, SourceOptions(), "top_first").images())


def test_progressive_images_are_refused(tmp_path):
    source = write(tmp_path / "a", [instant(2 * j) for j in range(N)])
    with pytest.raises(SourceError, match=r"marked as interlaced, .* no comb .* it is progressive"):
        open_camera_source(camera(source))
    assert open_camera_source(camera(source, None)).n_images == N


def test_an_odd_number_of_lines_is_refused(tmp_path):
    source = write(tmp_path / "a", [instant(0)[:71]])
    with pytest.raises(SourceError, match="71 lines are not an even number"):
        InterlacedSource(source, SourceOptions(), "top_first")


def test_unreadable_images_are_counted(tmp_path):
    folder = woven(tmp_path / "a")
    (folder / "image2.png").write_bytes(b"not a picture")
    source = InterlacedSource(folder, SourceOptions(), "top_first")
    assert len(list(source)) == 2 * N - 2 and source.counts.missing == 1


def test_images_of_another_size_are_counted(tmp_path):
    folder = woven(tmp_path / "a")
    cv2.imwrite(str(folder / "image2.png"), np.zeros((6, 8, 3), np.uint8))
    source = InterlacedSource(folder, SourceOptions(), "top_first")
    assert len(list(source)) == 2 * N - 2 and source.counts.unusable == 1 and "image2.png" in source.counts.problems[0]


def test_the_rig_file_says_it(tmp_path):
    rig = CameraRig((camera(tmp_path / "a"), replace(camera(tmp_path / "b", None), name="right")))
    path = tmp_path / "rig.yaml"
    write_rig_file(rig_file_of(rig), path)
    assert [c.interlaced for c in load_rig(path)] == ["top_first", None]
    path.write_text(path.read_text().replace("top_first", "upper_first"))
    with pytest.raises(FileFormatError, match=r"cameras\.left\.interlaced"):
        load_rig(path)
