"""Whatever a request says, the digitizing desk answers or refuses it in words, and what it has saved can be read."""

import json
import os
from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from helpers.cameras.render_scenes import LENSES, look_at
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import TrackerError
from tracker_node.loaders.file_model import validate
from tracker_node.studio.digitize.click_store import ClickStore
from tracker_node.studio.digitize.page import Asked, AskedClick, AskedName, DigitizePage
from tracker_node.studio.images import SetNumbers
from tracker_node.studio.session import StudioFiles, StudioSession

RIG = CameraRig(
    (
        look_at((2.0, 0.3, 1.2), (0.0, 0.0, 0.8), LENSES["radial"], "a"),
        look_at((-0.6, 2.1, 1.0), (0.0, 0.0, 0.8), LENSES["plain"], "b"),
    )
)
ODD = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.lists(st.floats(), max_size=3),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)  # fmt: skip
FIELDS = {
    "set": st.integers(0, 1),
    "sheet": st.sampled_from(["first", "second", "control"]),
    "point": st.sampled_from(["hip", "corner", "no such"]),
    "camera": st.sampled_from(["a", "b", "c"]),
    "pixel": st.one_of(st.none(), st.tuples(st.floats(-5.0, 200.0), st.floats(-5.0, 200.0)).map(list)),
    "sigma_px": st.floats(1e-3, 1e3),
    "constraint": st.sampled_from(["square", "none"]),
    "name": st.text(max_size=6),
    "odd": ODD,
}
USED = {"click": FIELDS.keys() - {"name", "odd"}, "sheet": FIELDS.keys() - {"name", "odd", "camera", "pixel"}, "point": {"name"}}
KINDS = {"click": AskedClick, "sheet": Asked, "repeatability": Asked, "save": Asked, "point": AskedName}


@st.composite
def requests(draw):
    """An action and its body, mostly a possible one: now and then a field is odd, missing or unknown."""
    action = draw(st.sampled_from(["click", "click", "click", *KINDS]))
    body = {name: draw(FIELDS[name]) for name in sorted(USED.get(action, USED["sheet"]))}
    if draw(st.integers(0, 5)) == 0:
        body[draw(st.sampled_from(sorted(FIELDS)))] = draw(ODD)
    return action, body


@pytest.fixture
def session(tmp_path):
    (tmp_path / "object.csv").write_text("point,x,y,z\ncorner,0.1,0.2,0.9\n")
    files = StudioFiles(clicks=tmp_path / "clicks", control_points=tmp_path / "object.csv")
    return StudioSession(files, RIG, images=SimpleNamespace(sets=(SetNumbers(0, {}), SetNumbers(40_000_000, {}))))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(requests(), min_size=1, max_size=12))
def test_any_request_is_answered_or_refused_in_words(session, wanted):
    desk = DigitizePage(session)
    desk.add_point(AskedName(name="hip"))
    actions = {
        "click": desk.click,
        "sheet": desk.sheet,
        "repeatability": desk.repeatability,
        "save": desk.save,
        "point": desk.add_point,
    }
    for action, body in wanted:
        try:
            answer = actions[action](validate(KINDS[action], body, "request"))
        except TrackerError as error:
            assert str(error)
        else:
            json.dumps(answer, allow_nan=False)
    again = ClickStore(session.files.clicks, RIG.names, desk.facts()["places"])
    now = desk.sheet(Asked(set=0, sheet="first"))["clicks"]
    saved = again.clicked("first", 0)
    assert {camera: {name: list(pixel) for name, pixel in points.items()} for camera, points in saved.items()} == now


def test_a_second_studio_may_look_at_the_same_clicks_but_change_them_only_after_the_first_has_ended(session):
    second_session = replace(session, closing=ExitStack())
    second = DigitizePage(second_session)
    assert second.facts()["points"] == []
    with session.closing:
        DigitizePage(session).add_point(AskedName(name="hip"))
        with pytest.raises(TrackerError, match=rf"clicks: process {os.getpid()} works in this folder"):
            second.add_point(AskedName(name="knee"))
    with second_session.closing:
        assert second.add_point(AskedName(name="knee"))["points"] == ["hip", "knee"]


def test_looking_makes_no_folder(session):
    desk = DigitizePage(session)
    desk.facts()
    desk.sheet(Asked(set=0, sheet="first"))
    desk.repeatability(Asked(set=0, sheet="first"))
    assert not session.files.clicks.exists()
    desk.add_point(AskedName(name="hip"))
    assert (session.files.clicks / ".claimed").exists()
    session.closing.close()
