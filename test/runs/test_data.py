"""Reading what a run left behind."""

import numpy as np
import pytest

from helpers.bodies.stick_person import Motion, motion, write_run, write_state_bag
from tracker_node.errors import FileFormatError, UnknownNameError
from tracker_node.loaders.bag.message_types import stamp_ns_of
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.motion.trajectory_file import CovariancesWriter
from tracker_node.runs.images import file_of
from tracker_node.runs.load import bag_of_run, file_of_run, is_run, load_run, run_of_messages, state_messages
from tracker_node.tracking.estimate import Status


def test_states_of_a_folder(tmp_path):
    tracked = motion(6)
    run = load_run(write_run(tmp_path / "run", tracked, ["INITIALIZING", *["TRACKING"] * 4, "LOST"]))
    assert run.stamps_ns.tolist() == tracked.stamps_ns.tolist()
    assert run.status.tolist() == [Status.INITIALIZING, *[Status.TRACKING] * 4, Status.LOST]
    assert run.cameras == () and run.camera_residuals.shape == (6, 0)
    landmarks = run.configuration(tracked.model, 3).landmarks_world
    assert landmarks == pytest.approx(tracked.landmarks_m[3], abs=1e-12)


@pytest.mark.parametrize("inside", ["", "bag"])
def test_states_of_a_bag_in_order_of_stamps(tmp_path, inside):
    tracked = motion(6)
    path = tmp_path / "recording"
    write_state_bag(path / inside if inside else path, tracked)
    run = load_run(path)
    assert run.stamps_ns.tolist() == tracked.stamps_ns.tolist()
    assert run.cameras == ("cam01", "cam02")
    assert run.camera_residuals[:, 1].tolist() == [3.0, 4.0] * 3
    assert run.configuration(tracked.model, 5).landmarks_world == pytest.approx(tracked.landmarks_m[5], abs=1e-9)


def test_cameras_that_were_taken_out_of_use_meanwhile_have_no_figures_then(tmp_path):
    """``ros2 param set /tracker cameras`` while a recorder runs."""
    with BagReader(write_state_bag(tmp_path / "bag", motion(6), cameras=("cam01", "cam02", "cam03"))) as reader:
        messages = sorted(state_messages(reader, "/person/state"), key=lambda message: stamp_ns_of(message.header.stamp))
    for message, kept in zip(messages[:3], ([1], [0, 2], [1]), strict=True):
        message.cameras = [message.cameras[k] for k in kept]
        message.camera_residuals, message.camera_samples = message.camera_residuals[kept], message.camera_samples[kept]
    run = run_of_messages(tmp_path / "bag", "/person/state", messages, {})
    assert run.cameras == ("cam01", "cam02", "cam03")
    assert run.camera_residuals.tolist() == [
        *([0.0, 3.0, 0.0], [3.0, 0.0, 5.0], [0.0, 3.0, 0.0], [3.0, 4.0, 5.0], [2.0, 3.0, 4.0], [3.0, 4.0, 5.0])
    ]
    assert run.camera_samples[:2].tolist() == [[0, 25, 0], [25, 0, 25]]
    messages[4].dof_names = [*messages[4].dof_names[:-1], "another"]
    with pytest.raises(FileFormatError, match=rf"one body throughout, got 'other dof_names at {run.stamps_ns[4]} ns"):
        run_of_messages(tmp_path / "bag", "/person/state", messages, {})


def test_figures_per_camera_come_from_the_bag_beside_the_states(tmp_path):
    tracked = motion(6)
    folder = write_run(tmp_path / "run", tracked)
    write_state_bag(folder / "bag", tracked)
    run = load_run(folder)
    assert run.residual.tolist() == [2.0, 3.0] * 3  # of states.csv
    assert run.camera_residuals[:, 0].tolist() == [2.0, 3.0] * 3


def test_smoothed_states_and_a_bag_belong_to_the_run_beside_them(tmp_path):
    write_run(tmp_path / "run" / "smoothed", motion(4))
    (tmp_path / "run" / "run.json").write_text('{"model": "person.yaml"}')
    assert load_run(tmp_path / "run" / "smoothed").info == {"model": "person.yaml"}
    write_state_bag(tmp_path / "run" / "bag", motion(4))
    assert load_run(tmp_path / "run" / "bag").info == {"model": "person.yaml"}
    (tmp_path / "run" / "bag" / "run.json").write_text('{"model": "own.yaml"}')  # a run whose folder has this name by chance
    assert load_run(tmp_path / "run" / "bag").info == {"model": "own.yaml"}


def test_what_the_tracker_says_beside_its_states(tmp_path):
    tracked = motion(6)
    details = load_run(write_state_bag(tmp_path / "bag", tracked)).details
    assert details.timings_ms.tolist() == [[1.0, 2.0, 3.0]] * 6
    assert details.limbs == () and details.covariances.shape == (6, tracked.model.chain.n_dof, tracked.model.chain.n_dof)
    folder = write_run(tmp_path / "run", tracked)
    assert load_run(folder).details is None
    write_state_bag(folder / "bag", Motion(tracked.model, tracked.stamps_ns[:4], tracked.states[:4]))
    assert np.isfinite(load_run(folder).details.timings_ms).all(axis=1).tolist() == [True] * 4 + [False] * 2


def test_covariances_of_a_smoothed_run(tmp_path):
    tracked = motion(5)
    folder, names = write_run(tmp_path / "smoothed", tracked), tracked.model.chain.dof_names
    with CovariancesWriter(folder / "covariances.csv", names) as writer:
        for i, stamp in enumerate(tracked.stamps_ns[1:], start=1):
            writer.append(int(stamp), i * np.eye(len(names)), np.eye(len(names)))
    found = load_run(folder).details
    assert found.covariances[:, 3, 3].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert np.isnan(found.timings_ms).all()


def test_what_cannot_be_a_run_is_named(tmp_path):
    with pytest.raises(FileFormatError, match="nothing there"):
        load_run(tmp_path / "missing")
    with pytest.raises(FileFormatError, match=r"states\.csv"):
        load_run(tmp_path)
    write_run(tmp_path / "run", motion(3), ["TRACKING", "SWIMMING", "LOST"])
    with pytest.raises(FileFormatError, match=r"line 3, column 'status'"):
        load_run(tmp_path / "run")


def test_an_unknown_topic_is_refused(tmp_path):
    write_state_bag(tmp_path / "bag", motion(2))
    with pytest.raises(UnknownNameError, match="valid: /person/state"):
        load_run(tmp_path / "bag", topic="/person/states")


def test_another_body_is_refused(tmp_path):
    from helpers.cameras.small_clip import body

    run = load_run(write_run(tmp_path / "run", motion(2)))
    with pytest.raises(FileFormatError, match=r"elbow_flexion.*and not"):
        run.check_model(body(), "arm.yaml")


def test_a_part_of_a_run_has_the_files_of_the_run_unless_its_own(tmp_path):
    bag = tmp_path / "bag"
    bag.mkdir()
    assert file_of_run(bag, "body.yaml") == file_of_run(tmp_path, "body.yaml") == tmp_path / "body.yaml"
    (bag / "body.yaml").touch()
    assert file_of_run(bag, "body.yaml") == bag / "body.yaml"


def test_the_folder_of_one_of_several_bodies_leads_to_its_states_in_their_bag(tmp_path):
    tracked = motion(3)
    write_state_bag(tmp_path / "run/bag", tracked, others=("anna",))
    with pytest.raises(FileFormatError, match="one topic of type"):
        load_run(tmp_path / "run")
    folder = tmp_path / "run/anna"
    folder.mkdir()
    (folder / "run.json").write_text('{"topic": "/anna/state", "options": {"model": "anna.yaml"}}')
    found = load_run(folder)
    assert is_run(folder) and len(found) == 3 and found.cameras == ("cam01", "cam02")
    assert found.bag == bag_of_run(folder) == tmp_path / "run/bag"
    assert file_of(found.info, "model") == "anna.yaml"
    (tmp_path / "run/run.json").write_text('{"bodies": {"person": {}, "anna": {}}}')
    with pytest.raises(FileFormatError, match=r"the folder of one body: \S*/run/anna, got 'that of several'"):
        load_run(tmp_path / "run")
    assert len(load_run(tmp_path / "run", "/person/state")) == 3
    (folder / "run.json").write_text("{}")
    with pytest.raises(FileFormatError, match=r"states\.csv"):
        load_run(folder)
