"""A person of the package's own model in smooth motion, as a run has found it, for tests of exports and kinematics."""

from pathlib import Path

import numpy as np

from tracker_node.geometry import se3, so3
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.motion.trajectory_file import StateRow, StateTrajectory, write_states
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.runs.motion import RunMotion

RATE_HZ = 60.0


def states(model: ArticulatedModel, n: int, rate_hz: float = RATE_HZ) -> list[State]:
    """Every joint swings around the middle of its range at its own pace while the root turns and travels."""
    chain, rng = model.chain, np.random.default_rng(5)
    pace, phase = rng.uniform(2.0, 6.0, chain.n_axes), rng.uniform(0.0, 6.0, chain.n_axes)
    lower, upper = np.maximum(chain.lower, -1.0), np.minimum(chain.upper, 1.0)
    found = []
    for t in np.arange(n) / rate_hz:
        root = se3.from_rotation_translation(so3.exp([0.1, 0.2 * t, 1.5 * t]), np.array([0.3 * t, 0.1, 0.9]))
        found.append(State(root, 0.5 * (lower + upper) + 0.4 * (upper - lower) * np.sin(pace * t + phase)))
    return found


def moving(n: int = 40, model: ArticulatedModel | None = None, gaps: tuple[int, ...] = (), rate_hz: float = RATE_HZ) -> RunMotion:
    """A motion at a constant rate, without a state in the rows ``gaps``."""
    model = model or human_model()
    valid = ~np.isin(np.arange(n), gaps)
    values = np.array([state.to_values() for state in states(model, n, rate_hz)]) * valid[:, None]
    stamps = 5_000_000_000 + np.round(np.arange(n) * 1e9 / rate_hz).astype(np.int64)
    return RunMotion(model, stamps, values, valid, 1e9 / rate_hz, uniform=True)


def write_run(folder: Path, motion: RunMotion, missing: tuple[int, ...] = ()) -> Path:
    """The folder of a run: ``model.yaml`` and ``states.csv``, LOST in the gaps of the motion, no row for those ``missing``."""
    folder.mkdir(parents=True)
    dump_model(motion.model, folder / "model.yaml")
    rows = [
        StateRow(int(motion.stamps_ns[i]), "TRACKING" if motion.valid[i] else "LOST", "", motion.values[i])
        for i in range(len(motion))
        if i not in missing
    ]
    write_states(folder / "states.csv", StateTrajectory(motion.model.chain.dof_names, tuple(rows), motion.model.chain.dof_units))
    (folder / "run.json").write_text(f'{{"model": "{folder / "model.yaml"}"}}')
    return folder
