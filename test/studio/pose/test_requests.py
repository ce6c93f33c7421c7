"""Whatever a page asks for is answered, or refused in one sentence."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.cameras.small_clip import make_clip
from tracker_node.errors import TrackerError
from tracker_node.loaders.file_model import validate
from tracker_node.studio.pose.page import Drag, Loaded, Pose, PoseInSet, PosePage, Saved
from tracker_node.studio.session import StudioFiles, open_session

N_DOF = 9
numbers = st.one_of(st.floats(-400, 400), st.floats(), st.sampled_from([0.0, 1e12, -1e12, 1e-300, 90.0, 180.0]))
anything = st.one_of(numbers, st.integers(), st.text(max_size=5), st.none(), st.lists(st.integers(), max_size=3))
values = st.one_of(st.lists(numbers, min_size=N_DOF, max_size=N_DOF), st.lists(anything, max_size=12), anything)
sets = st.one_of(st.integers(-1, 3), anything)
names = st.one_of(st.sampled_from(["rig.yaml", "model.yaml", "start.yaml", "new"]), st.text(max_size=8), anything)
QUESTIONS = {
    "show": (Pose, {"values": values}),
    "score": (PoseInSet, {"values": values, "set": sets}),
    "drag": (
        Drag,
        {
            "values": values,
            "handle": st.one_of(st.integers(-1, 7), anything),
            "camera": st.sampled_from(["cam01", "cam02", "cam09", ""]),
            "pixel": st.one_of(st.lists(numbers, min_size=2, max_size=2), anything),
            "mode": st.sampled_from(["limb", "joint", "body", "turn", "fly"]),
        },
    ),
    "load": (Loaded, {"name": names}),
    "keep": (PoseInSet, {"values": values, "set": sets}),
    "save": (Saved, {"values": values, "set": sets, "name": names, "overwrite": st.booleans()}),
}


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    clip = make_clip(tmp_path_factory.mktemp("clip"), n_images=2)
    return PosePage(open_session(StudioFiles(rig=clip.rig_file, model=clip.model_file, folder=clip.folder)))


@pytest.mark.parametrize("question", QUESTIONS)
@settings(max_examples=60)
@given(data=st.data())
def test_every_request_is_answered_or_refused(desk, question, data):
    kind, fields = QUESTIONS[question]
    asked = data.draw(st.fixed_dictionaries(fields))
    try:
        answer = getattr(desk, question)(validate(kind, asked, "request"))
    except TrackerError as error:
        assert "\n" not in str(error).strip()
    else:
        json.dumps(answer, allow_nan=False)
