"""True states over time: between rows, as states of a body, and from files."""

import numpy as np
import pytest

from helpers.bodies.moving_person import moving, write_run
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.truth.files import TrueStates, holds_states, load_true_states, unwrapped
from tracker_node.loaders.motion.trajectory_file import StateRow, StateTrajectory, write_states
from tracker_node.model.configuration import Configuration, State, to_variables, variable_names


def two_rows(valid=((True, True), (True, True), (True, False))):
    values = np.array([[0.0, 10.0], [1.0, 30.0], [5.0, 0.0]])
    return TrueStates(("x", "bend"), np.array([1000, 2000, 3000]), values, np.array(valid))


def test_between_rows_lines_are_straight():
    found = two_rows().at(np.array([1000, 1250, 2000]))
    assert found.values.tolist() == [[0.0, 10.0], [0.25, 15.0], [1.0, 30.0]] and found.valid.all()
    assert found.names == ("x", "bend") and found.stamps_ns.tolist() == [1000, 1250, 2000]


def test_what_is_not_valid_on_either_side_is_not_valid_between():
    for stamps, expected in (([2500], [True, False]), ([1500], [True, True]), ([999], [False] * 2), ([3001], [False] * 2)):
        found = two_rows().at(np.array(stamps))
        assert found.valid.tolist() == [expected]
        assert found.values[0][~found.valid[0]].tolist() == [0.0] * (2 - sum(expected))
    found = two_rows(((False, True), (True, True), (True, True))).at(np.array([1500]))
    assert found.valid.tolist() == [[False, True]] and found.values.tolist() == [[0.0, 20.0]]


def test_images_that_are_late_show_what_was_earlier():
    found = two_rows().at(np.array([1500, 2000]), 250.0)
    assert found.values.tolist() == [[0.25, 15.0], [0.75, 25.0]]
    later = two_rows().shifted(100)
    assert later.stamps_ns.tolist() == [1100, 2100, 3100]
    assert later.values.tolist() == two_rows().values.tolist() and later.valid.tolist() == two_rows().valid.tolist()


def of_motion(motion, names=None):
    """The variables of a motion, with the columns in another order."""
    wanted = variable_names(motion.model)
    names = names or wanted[::-1]
    variables = np.array([to_variables(State.from_values(row), None) for row in motion.values])
    columns = [wanted.index(name) for name in names]
    return TrueStates(names, motion.stamps_ns, variables[:, columns], np.ones((len(motion), len(names)), bool))


def test_states_of_a_body_whatever_the_order_of_the_columns():
    motion = moving(3)
    truth = of_motion(motion)
    truth.valid[1, 4] = False
    first, second, third = truth.states(motion.model)
    assert second is None
    for state, i in ((first, 0), (third, 2)):
        assert state.difference(State.from_values(motion.values[i])) == pytest.approx(np.zeros(motion.model.n_dof), abs=1e-9)
    joints = truth.joints(motion.model)
    assert joints.names == motion.model.landmark_names and joints.stamps_ns is truth.stamps_ns
    assert joints.valid.all(axis=1).tolist() == joints.valid.any(axis=1).tolist() == [True, False, True]
    assert joints.positions_m[2] == pytest.approx(Configuration(motion.model, third).landmarks_world)
    assert not joints.positions_m[1].any()


def test_without_one_of_the_variables_there_is_no_state():
    motion = moving(2)
    truth = of_motion(motion, variable_names(motion.model)[1:])
    assert truth.states(motion.model) == (None, None) and not truth.joints(motion.model).valid.any()


def test_which_files_hold_states(tmp_path):
    states = write_run(tmp_path / "run", moving(2)) / "states.csv"
    assert holds_states(states) and holds_states("a.mot") and holds_states("a.STO")
    upper = tmp_path / "UPPER.CSV"
    upper.write_bytes(states.read_bytes())
    assert holds_states(upper)
    (tmp_path / "joints.csv").write_text("stamp_ns,neck_x\n1,2\n")
    assert not holds_states(tmp_path / "joints.csv") and not holds_states("a.trc")
    (tmp_path / "states.txt").write_bytes(states.read_bytes())
    assert not holds_states(tmp_path / "states.txt")


def write(path, motion, rows):
    chain = motion.model.chain
    found = tuple(StateRow(stamp, status, "", values) for stamp, status, values in rows)
    write_states(path, StateTrajectory(chain.dof_names, found, chain.dof_units))
    return path


def test_rows_of_a_file_in_order_of_time_the_last_of_a_stamp_and_only_those_with_a_state(tmp_path):
    motion = moving(6)
    v = motion.values
    rows = [
        *((300, "TRACKING", v[3]), (100, "TRACKING", v[0]), (200, "LOST", v[2]), (100, "DEGRADED", v[1])),
        *((400, "INITIALIZING", v[4]), (500, "TRACKING", np.full(v.shape[1], np.nan)), (600, "TRACKING", v[5])),
    ]
    found = load_true_states(write(tmp_path / "a.csv", motion, rows))
    assert found.stamps_ns.tolist() == [100, 200, 300, 400, 500, 600]
    assert found.valid.all(axis=1).tolist() == found.valid.any(axis=1).tolist() == [True, False, True, False, False, True]
    assert found.values[~found.valid].tolist() == [0.0] * (3 * len(found.names))
    assert found.names[:6] == ("x", "y", "z", "somersault", "tilt", "twist")
    assert found.names[6:] == motion.model.chain.dof_names[6:]
    assert found.values[0, :3] == pytest.approx(v[1, :3]) and found.values[2, 6:] == pytest.approx(v[3, 6:])


def test_a_file_without_rows_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match="at least one row"):
        load_true_states(write(tmp_path / "a.csv", moving(1), []))


def turned(angle):
    """Values of a body of one link about the world's y axis; the root's angle between -pi and pi."""
    return [0.0, 0.0, 0.0, 0.0, angle, 0.0]


def test_full_turns_are_counted_on_across_rows_without_a_state():
    angles = [3.0, np.nan, -3.0, -2.0]
    values = np.array([turned(angle) for angle in angles])
    found = unwrapped(values)
    assert np.isnan(found[1]).all() and np.isfinite(found[[0, 2, 3]]).all()
    k = int(np.argmax(np.abs(found[3] - found[2])))
    steps = found[2, k] - found[0, k], found[3, k] - found[2, k]
    assert np.abs(steps) == pytest.approx([2 * np.pi - 6.0, 1.0], abs=1e-6)


def test_angles_stay_near_those_that_are_given():
    values = np.array([turned(0.5), turned(0.5)])
    first = unwrapped(values)[0]
    k = int(np.argmax(np.abs(first)))
    beside = first.copy()
    beside[k] += 2 * np.pi
    assert unwrapped(values, [beside, None]) == pytest.approx(np.array([beside, beside]))
    assert unwrapped(values, [None, beside]) == pytest.approx(np.array([first, beside]))
