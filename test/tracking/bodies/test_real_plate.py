"""The first sets of the recorded ChArUco plate, through the tracker as its benchmark runs it."""


import numpy as np

from benchmark.color import plate as benchmark
from tracker_node.runs.config_file import load_config
from tracker_node.tracking.estimate import Status


def test_a_real_plate_is_followed_from_its_first_pose(shared_data, repository):
    config = load_config(repository / "config" / "textured_plate.yaml")
    recording = benchmark.read(shared_data / benchmark.FOLDER, config, at_most=6)
    assert len(recording.sets) == 6
    assert recording.fit_mm < 2.0
    assert recording.reprojection_px < 3.0
    estimates = benchmark.track(recording, benchmark.plate(), config, range(6))
    off = np.array([benchmark.errors(e, truth) for e, truth in zip(estimates, recording.truth, strict=True)])
    assert off[:, 0].max() < 3.0
    assert off[:, 1].max() < 1.5
    assert Status.LOST not in {estimate.status for estimate in estimates}
    deviations = 1e3 * np.sqrt([np.trace(e.covariance[:3, :3]) for e in estimates])
    assert np.all((deviations > 0.05) & (deviations < 5.0))
