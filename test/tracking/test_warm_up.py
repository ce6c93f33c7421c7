"""After the warm-up no code is compiled or loaded any more, whatever images come."""

import subprocess
import sys
from pathlib import Path

import pytest

from helpers.ros.samples import tracked_arm, write_recording
from tracker_node.errors import TrackerError
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.warm_up import warm_up

N = 5
# In a process of its own: here other tests have loaded the code. Images are views of messages, which cannot be written to.
TRACK = """
import gc, sys
from pathlib import Path
import cv2
import numpy as np
from numba.core.dispatcher import Dispatcher
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.keypoints import LandmarkPoint
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.tracker import Tracker
from tracker_node.tracking.warm_up import warm_up

folder, n = Path(sys.argv[1]), int(sys.argv[2])
rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "model.yaml")
state = load_state(folder / "state.yaml", model) if sys.argv[3] != "looked for" else None
table, config = None, from_dict({})
if sys.argv[3] == "with points":
    table = {name: LandmarkPoint(name) for name in model.landmark_names}
    config = from_dict({"modalities": ["region", "keypoints"]})

def image(camera, i):
    pixels = cv2.imread(str(folder / camera / f"{i:04}.png"))
    pixels.flags.writeable = False
    people = None
    if table:
        at = rig[camera].project(Configuration(model, state).landmarks_world)[0]
        box = (*(at.min(axis=0) - 9).tolist(), *(at.max(axis=0) + 9).tolist())
        people = (Person(tuple(table), at, np.tile(np.eye(2), (len(at), 1, 1)), np.ones(len(at)), 1.0, box),)
    return CameraImage(camera, i * 33_000_000, pixels, people=people)

def in_memory():
    kernels = [kernel for kernel in gc.get_objects() if isinstance(kernel, Dispatcher)]
    named = [(kernel.py_func.__module__, kernel.py_func.__qualname__, kernel.signatures) for kernel in kernels]
    return {(module, name, signature) for module, name, signatures in named for signature in signatures}

warm_up(rig, model, config, state, None, table)
before = in_memory()
tracker = Tracker(rig, model, config, load_backgrounds(rig), state, None, table)
for i in range(n):
    tracker.step(ImageSet(i * 33_000_000, tuple(image(camera, i) for camera in rig.names)))
print(len(before), "new:", *(f"{module}.{name}" for module, name, _ in in_memory() - before))
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("warm_up") / "arm"
    write_recording(folder, N)
    return folder


@pytest.mark.parametrize("state", ["given", "with points", pytest.param("looked for", marks=pytest.mark.long)])
def test_nothing_is_loaded_after_it(recording, state):
    command = [sys.executable, "-c", TRACK, str(recording), str(N), state]
    answer = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    count, _, new = answer.partition(" new:")
    assert int(count) > 20 and not new.strip(), answer


def test_what_does_not_suit_the_body_is_said(recording):
    config = from_dict({"modalities": ["texture"]})
    with pytest.raises(TrackerError, match="no box with a texture"):
        warm_up(load_rig(recording / "rig.yaml"), tracked_arm(), config)
