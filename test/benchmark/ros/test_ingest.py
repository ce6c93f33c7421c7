"""The benchmark of the ingest: its videos say their numbers through codec and halving, its figures count what is missing."""


import pytest

from benchmark.ros import ingest
from tracker_node.loaders.images.source import open_source


def test_numbers_survive_the_codec_and_halving(tmp_path):
    ingest._write_video(0, tmp_path / "a.mp4", 6)
    images = [image for _, image in open_source(tmp_path / "a.mp4", shrink=ingest.SHRINK)]
    assert images[0].shape == (ingest.HEIGHT // 2, ingest.WIDTH // 2, 3)
    assert [ingest.number_of(image) for image in images] == list(range(6))


def test_figures():
    said = ["cam1: 9 published, 1 skipped, 2 late", "cam2: 8 published, 2 dropped", "recorded: 3 messages"]
    usage = [(0.1 * i, 0.05 * i, 0.01 * i) for i in range(50)]  # half a core, and a tenth
    received = {"latencies_ms": [10.0] * 16 + [20.0], "wrong": 0, "span_s": 0.3}
    figures = ingest.figures(20, said, received, usage)
    assert (figures["ingest.lost"], figures["ingest.published"], figures["ingest.skipped_to_keep_the_rate"]) == (3, 17, 3)
    assert figures["ingest.cpu_cores"] == pytest.approx(0.5) and figures["ingest.receiver_cpu_cores"] == pytest.approx(0.1)
    assert (figures["ingest.latency_ms_p50"], figures["ingest.latency_ms_max"]) == (10.0, 20.0)
