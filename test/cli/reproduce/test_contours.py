"""``reproduce contours``, small, from one end to the other, and what it does when it is given what it cannot use."""

import json

import cv2
import numpy as np
import pytest

from tracker_node.cli import sample
from tracker_node.cli.groups import reproduce
from tracker_node.cli.main import main
from tracker_node.errors import SourceError, TrackerError
from tracker_node.experiments.contour import experiment
from tracker_node.experiments.contour.clips import synthetic_clip
from tracker_node.experiments.contour.errors import METHODS, PUBLISHED

PICTURES = (
    "fig3_row", "fig3_body", "fig3_tracking", "fig4_evidence", "fig5_cameras", "fig6_cones", "fig6_mannequin_swing",
)  # fmt: skip
VARIABLES = {
    "root_x": ("mm", 10.0), "root_rz": ("deg", 5.0), "right_elbow_flexion": ("deg", 5.0), "left_hip_flexion": ("deg", 5.0),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("contours")
    arguments = ["--quick", "--output", str(folder / "out"), "--recordings", str(folder / "clips")]
    assert main(["reproduce", "contours", *arguments]) == 0
    return folder


@pytest.fixture(scope="module")
def metrics(folder):
    return json.loads((folder / "out/metrics.json").read_text())["metrics"]


@pytest.mark.long
def test_the_sum_has_its_minimum_at_the_truth(metrics):
    """Within a pixel or two for the part, within a step of the coarse grid for the body."""
    for part in ("part", "thin_part"):
        assert metrics[f"contours.row.{part}.sum.minimum_off_px"] <= 2.0
        assert metrics[f"contours.row.{part}.sum.rising_px"] >= 30.0
    for dof, (unit, step) in VARIABLES.items():
        assert metrics[f"contours.row.{dof}.sum.minimum_off_{unit}"] <= step


@pytest.mark.long
def test_silhouettes_alone_leave_a_thin_part_free(metrics):
    flat = {key: metrics[f"contours.row.thin_part.{key}.flat_px"] for key in PUBLISHED}
    assert flat["silhouette"] > 5.0 and flat["silhouette"] > 1.5 * flat["sum"]


@pytest.mark.long
def test_every_clip_is_tracked_by_each_method(metrics):
    for clip in ("cones", "mannequin_swing"):
        for method in METHODS[:-1]:
            prefix = f"contours.{clip}.{method}"
            assert metrics[f"{prefix}.image_sets"] == 6
            assert 0.0 < metrics[f"{prefix}.mpjpe_offset_free_mm"] <= metrics[f"{prefix}.mpjpe_mm"]
            assert 0.0 < metrics[f"{prefix}.iterations"] <= 30.0
        assert metrics[f"contours.{clip}.sum.mpjpe_mm"] < 100.0
    assert metrics["contours.cones.sum.lost_sets"] == 0


@pytest.mark.long
def test_the_sliding_term_changes_iterations_rather_than_errors(metrics):
    for distances in ("sum", "split"):
        prefix = f"contours.cones.sliding_{distances}"
        assert metrics[f"{prefix}.mpjpe_with_mm"] == pytest.approx(metrics[f"{prefix}.mpjpe_without_mm"], abs=10.0)
        assert 0.5 < metrics[f"{prefix}.iterations_ratio"] < 4.0
        with_, without = metrics[f"{prefix}.iterations_with"], metrics[f"{prefix}.iterations_without"]
        assert metrics[f"{prefix}.iterations_ratio"] == pytest.approx(without / with_)


@pytest.mark.long
def test_it_leaves_pictures_a_table_and_a_page(folder):
    for name in PICTURES:
        picture = cv2.imread(str(folder / f"out/{name}.png"))
        assert picture is not None and picture.std() > 10.0, name
        assert min(picture.shape[:2]) > 200
    table = (folder / "out/table.txt").read_text()
    assert "paper: synthetic and real" in table and "cones, silhouettes only" in table
    page = (folder / "out/report.html").read_text()
    assert page.count("data:image/png") == len(PICTURES)
    assert "Fig. 3" in page and "Fig. 6" in page


@pytest.mark.long
def test_contours_are_drawn_over_the_images(folder):
    """Yellow outlines, which the room does not have."""
    for name in ("fig5_cameras", "fig6_cones"):
        b, g, r = np.moveaxis(cv2.imread(str(folder / f"out/{name}.png")).astype(int), 2, 0)
        assert np.mean((r > 220) & (g > 190) & (b < 130)) > 1e-3, name


@pytest.mark.long
def test_single_image_sets_of_a_clip(folder):
    clip = synthetic_clip(folder / "clips/small_cones-6", "cones")
    stamps = [image_set.stamp_ns for image_set in clip.stream()]
    assert len(stamps) == 6 and [s.stamp_ns for s in clip.sets_at([1, 4])] == [stamps[1], stamps[4]]


def test_a_sample_that_is_asked_for_and_cannot_be_had_is_an_error(no_index, tmp_path, capsys):
    arguments = ["--clips", "balancing", "--sample", str(tmp_path / "none"), "--output", str(tmp_path / "out")]
    assert main(["reproduce", "contours", *arguments]) == 2
    error = capsys.readouterr().err
    assert "could not be fetched from the package index" in error.splitlines()[-1] and "Traceback" not in error


def test_a_sample_whose_preparation_has_broken_off_is_prepared_again(monkeypatch, tmp_path):
    """recording.yaml is written even where the body could not be measured."""
    (tmp_path / "recording.yaml").touch()
    monkeypatch.setattr(sample, "prepare", lambda folder: 1)
    with pytest.raises(TrackerError, match="could not be prepared"):
        reproduce._sample(tmp_path)


def test_without_the_sample_the_rest_is_measured(monkeypatch, tmp_path, capsys):
    def missing(*_):
        raise SourceError("pose2sim", "could not be fetched")

    monkeypatch.setattr(experiment, "cones_clip", lambda *_: "cones")
    monkeypatch.setattr(experiment, "mannequin_clip", lambda *_: "mannequin")
    monkeypatch.setattr(experiment, "balancing_clip", missing)
    assert experiment.make_clips(None, tmp_path, None, lambda: tmp_path, False) == {"cones": "cones", "mannequin": "mannequin"}
    assert "NOT MEASURED: balancing" in capsys.readouterr().err


def test_a_folder_without_motions_is_named(tmp_path, capsys):
    arguments = ["--clips", "mannequin", "--motions", str(tmp_path / "nowhere"), "--output", str(tmp_path / "out")]
    assert main(["reproduce", "contours", *arguments]) == 2
    assert "nowhere" in capsys.readouterr().err.splitlines()[-1]


def test_unknown_clips_are_answered(capsys):
    with pytest.raises(SystemExit) as leaving:
        main(["reproduce", "contours", "--clips", "juggling"])
    assert leaving.value.code == 2 and "juggling" in capsys.readouterr().err
