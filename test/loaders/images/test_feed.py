"""Several sources on one clock."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tracker_node.errors import SourceError
from tracker_node.loaders.images.feed import ImageFeed
from tracker_node.loaders.images.source import open_source


@pytest.fixture
def folders(tmp_path: Path) -> dict[str, Path]:
    """Three cameras of 5, 5 and 3 images; each image's pixels say camera and number."""
    result = {}
    for c, (camera, n) in enumerate({"a": 5, "b": 5, "c": 3}.items()):
        result[camera] = tmp_path / camera
        result[camera].mkdir()
        for i in range(n):
            cv2.imwrite(str(result[camera] / f"{i}.png"), np.full((20, 30, 3), 10 * c + i, np.uint8))
    return result


@pytest.mark.parametrize("ahead", [True, False])
def test_sets_in_order_with_every_image(folders: dict[str, Path], ahead: bool):
    offsets = {"a": 0, "b": 5_000_000, "c": -3_000_000}  # well within 0.4 of 40 ms
    sources = {camera: open_source(path, rate_hz=25.0, base_stamp_ns=offsets[camera]) for camera, path in folders.items()}
    with ImageFeed(sources, ahead) as feed:
        feed_sets = list(feed)
    assert [[image.camera for image in feed_set.images] for feed_set in feed_sets] == [["a", "b", "c"]] * 3 + [["a", "b"]] * 2
    assert [feed_set.stamp_ns for feed_set in feed_sets] == [-3_000_000, 37_000_000, 77_000_000, 120_000_000, 160_000_000]
    for i, feed_set in enumerate(feed_sets):
        for image in feed_set.images:
            assert image.bgr[0, 0, 0] == 10 * "abc".index(image.camera) + i
            assert image.stamp_ns == offsets[image.camera] + 40_000_000 * i
    assert all(report.ended and not report.problem for report in feed.reports.values())
    assert [report.read for report in feed.reports.values()] == [5, 5, 3]


@pytest.mark.parametrize("ahead", [True, False])
def test_a_source_that_fails_ends_and_is_named_and_the_others_go_on(folders: dict[str, Path], ahead: bool, monkeypatch):
    sources = {camera: open_source(folders[camera], rate_hz=25.0) for camera in "ab"}
    read = sources["b"]._read

    def fails(start, end):
        yield from read(start, 2)
        raise SourceError(str(folders["b"]), "is gone")

    monkeypatch.setattr(sources["b"], "_read", fails)
    with ImageFeed(sources, ahead) as feed:
        sizes = [len(feed_set.images) for feed_set in feed]
    assert sizes == [2, 2, 1, 1, 1]
    assert "is gone" in feed.reports["b"].problem and not feed.reports["a"].problem


def test_repeated_images_are_marked(folders: dict[str, Path]):
    (folders["a"] / "3.png").write_bytes((folders["a"] / "2.png").read_bytes())
    with ImageFeed({"a": open_source(folders["a"])}) as feed:
        assert [feed_set.images[0].repeats for feed_set in feed] == [False, False, False, True, False]


def test_close_ends_the_threads_in_the_middle(folders: dict[str, Path]):
    feed = ImageFeed({"a": open_source(folders["a"], loop=True)})
    assert next(iter(feed)).stamp_ns == 0
    feed.close()
    assert not any(thread.is_alive() for thread in feed._threads)
