"""The playback page in a browser: what a run says at each instant, over the images that it was made from."""

import json
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.small_clip import RATE_HZ, make_clip
from helpers.sources.bag_samples import image
from helpers.studio.browser import browser_tab
from helpers.studio.studio_process import running_studio
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.loaders.bag.message_types import message_of
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.motion.trajectory_file import read_states
from tracker_node.runs.load import load_run
from tracker_node.runs.messages import CAMERA_INFO, camera_info
from tracker_node.studio.playback.page import PlaybackPage, open_run
from tracker_node.studio.session import StudioFiles, open_session

FIRST, N_IMAGES = 2, 9


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Some images of the clip tracked; the run does not begin with the first of them."""
    clip = make_clip(tmp_path_factory.mktemp("clip"), n_images=N_IMAGES)
    run = ["track", *clip.arguments(), "--output", str(clip.folder / "run"), "--start", str(FIRST), "--quiet"]
    assert main([*run, "--base-stamp-ns", "5000000000"]) == 0
    return clip


def files(clip, **changes):
    return StudioFiles(**{"rig": clip.rig_file, "model": clip.model_file, "run": clip.folder / "run", **changes})


def test_states_come_with_the_images_that_they_were_made_from(clip):
    played = open_run(open_session(files(clip)))
    assert len(played.numbers) == N_IMAGES - FIRST and played.problem == ""
    assert [numbers["cam02"] for numbers in played.numbers] == list(range(FIRST, N_IMAGES))
    expected = cv2.imread(str(clip.folder / "cam02" / f"{FIRST + 3:04d}.png"))
    np.testing.assert_array_equal(played.images.bgr("cam02", played.numbers[3]["cam02"]), expected)


def test_a_run_without_its_bag_goes_by_the_time(clip, tmp_path):
    (tmp_path / "states.csv").write_bytes((clip.folder / "run/states.csv").read_bytes())
    (tmp_path / "run.json").write_bytes((clip.folder / "run/run.json").read_bytes())
    played = open_run(open_session(files(clip, run=tmp_path)))
    assert [numbers["cam01"] for numbers in played.numbers] == list(range(FIRST, N_IMAGES))


def test_reasons_come_from_the_bag_or_the_table(clip, tmp_path):
    """Of a run in which a camera gives no images, so that every state is DEGRADED for a reason."""
    rig = clip.folder / "rig_of_one_gone.yaml"
    rig.write_text(clip.rig_file.read_text().replace("source: cam03", "source: nowhere"))
    run = ["track", *clip.arguments(), "--rig", str(rig), "--output", str(tmp_path / "run"), "--quiet", "--max-sets", "3"]
    main(run)
    of_bag = open_run(open_session(files(clip, run=tmp_path / "run"))).reasons
    (tmp_path / "table").mkdir()
    (tmp_path / "table/states.csv").write_bytes((tmp_path / "run/states.csv").read_bytes())
    assert open_run(open_session(files(clip, run=tmp_path / "table"))).reasons == of_bag
    assert len(of_bag) == 3 and all("2 of 3 cameras" in reason for reason in of_bag)
    shown = PlaybackPage(open_session(files(clip, run=tmp_path / "run"))).run()
    residuals = dict(zip(shown["residual_cameras"], zip(*shown["camera_residuals"], strict=True), strict=True))
    assert residuals["cam03"] == (None, None, None) and all(value > 0.0 for value in residuals["cam01"])


def test_images_come_from_the_bag_that_was_tracked(clip, tmp_path):
    """With stamps of their own, and in another size than the rig's sources have."""
    bag, begins_ns = tmp_path / "images", 1_700_000_000_000_000_000
    with BagWriter(bag) as writer:
        for i in range(4):
            for name in clip.rig.names:
                stamp_ns = begins_ns + round(i * 1e9 / RATE_HZ)
                pixels = cv2.resize(cv2.imread(str(clip.folder / name / f"{i:04d}.png")), (80, 60), interpolation=cv2.INTER_AREA)
                camera = replace(clip.rig[name], model=clip.rig[name].model.resized(80, 60))
                info = camera_info(stamp_ns, camera.frame_id, camera.model)
                writer.write_message(f"/{name}/camera_info", stamp_ns, message_of(CAMERA_INFO, info))
                writer.write_message(f"/{name}/image_raw", stamp_ns, image(stamp_ns, pixels))
    run = ["track", *clip.arguments(), "--bag", str(bag), "--output", str(tmp_path / "run"), "--quiet"]
    assert main(run) == 0
    played = open_run(open_session(files(clip, run=tmp_path / "run")))
    assert [numbers["cam03"] for numbers in played.numbers] == [0, 1, 2, 3] and played.problem == ""
    assert played.rig["cam03"].model.width == 80 and played.images.bgr("cam03", 2).shape == (60, 80, 3)
    half = cv2.resize(cv2.imread(str(clip.folder / "cam03/0002.png")), (80, 60), interpolation=cv2.INTER_AREA)
    np.testing.assert_array_equal(played.images.bgr("cam03", 2), half)


def test_a_run_whose_images_are_gone_is_played_without(clip, tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text(clip.rig_file.read_text())  # whose sources lie relative to it
    played = open_run(open_session(files(clip, rig=rig)))
    assert not any(played.numbers) and "cam01" in played.problem and len(played.data) == N_IMAGES - FIRST


def test_what_is_no_run_of_this_body_is_refused(clip, tmp_path):
    with pytest.raises(TrackerError, match="--run"):
        open_run(open_session(files(clip, run=None)))
    with pytest.raises(FileFormatError, match=r"states\.csv"):
        open_run(open_session(files(clip, run=tmp_path)))
    options = {"options": {"start": -3}}
    (tmp_path / "states.csv").write_bytes((clip.folder / "run/states.csv").read_bytes())
    (tmp_path / "run.json").write_text(json.dumps(options))
    assert "start" in open_run(open_session(files(clip, run=tmp_path))).problem


@pytest.fixture(scope="module")
def desk(clip):
    arguments = ["--rig", clip.rig_file, "--model", clip.model_file, "--run", clip.folder / "run"]
    with running_studio(*arguments) as studio, browser_tab() as tab:
        yield studio, tab


@pytest.fixture
def page(desk):
    studio, tab = desk
    tab.page.goto(studio.page("playback.html"))
    tab.page.wait_for_selector("#status")
    tab.page.wait_for_selector("body[aria-busy=false]")
    yield tab.page
    assert tab.errors == []


def row(page):
    return int(page.inner_text("#where").split()[1])


def test_the_page_says_what_the_run_says(page, clip):
    run = load_run(clip.folder / "run")
    for i in range(3):
        shown = page.inner_text("#state")
        assert run.status[i] == 1 and "tracking" in shown.lower()
        numbers = [float(number) for number in re.findall(r"([\d.]+) px", shown)]  # of all, then of each camera, rounded
        assert numbers[:2] == pytest.approx([run.residual[i], run.camera_residuals[i, 0]], abs=0.0055)
        assert f"{(i / RATE_HZ):.3f} s" in page.inner_text("#where")
        page.keyboard.press("ArrowRight")
    assert run.details is None or not run.details.limbs or run.details.limbs[0] in page.inner_text("#state")


def test_keys_and_mouse_go_through_the_run(page):
    n = N_IMAGES - FIRST
    picture = page.locator("canvas[aria-label='camera cam01']")
    page.wait_for_timeout(300)
    first = picture.screenshot()
    for key, expected in (("End", n - 1), ("ArrowLeft", n - 2), ("Home", 0), ("Shift+ArrowRight", n - 1), ("Home", 0)):
        page.keyboard.press(key)
        assert row(page) == expected, key
    box = page.locator("#timeline").bounding_box()
    page.mouse.click(box["x"] + box["width"] * 0.5, box["y"] + 12)  # on the status strip
    assert 0 < row(page) < n - 1
    page.wait_for_selector("body[aria-busy=false]")
    page.wait_for_timeout(300)
    assert picture.screenshot() != first
    page.keyboard.press("n")
    page.wait_for_selector(".message:has-text('no trouble')")


def test_it_plays_to_the_end(page):
    page.select_option("#speed", "2")
    page.keyboard.press("Escape")
    page.click("#play")
    page.wait_for_selector(f"#where:has-text('set {N_IMAGES - FIRST - 1} of')", timeout=20000)
    page.wait_for_selector("#play:has-text('Play')")


def test_curves_are_chosen_by_name(page, clip):
    page.fill("#filter", "shoulder y")
    boxes = page.locator("#dofs label:not([hidden])")
    assert boxes.count() == 1
    plain = page.locator("#timeline").screenshot()
    boxes.locator("input").check()
    page.wait_for_selector("body[aria-busy=false]")
    page.wait_for_timeout(200)
    assert page.locator("#timeline").screenshot() != plain
    answer = page.evaluate(
        "async () => (await fetch('/api/playback/curve', {method: 'POST', body: JSON.stringify({name: 'shoulder_y'})})).json()"
    )
    states = read_states(clip.folder / "run/states.csv")
    expected = np.rad2deg(states.values[:, states.dof_names.index("shoulder_y")])
    np.testing.assert_allclose(answer["values"], expected, atol=1e-4)


@pytest.mark.long
def test_the_first_image_set_is_drawn_whenever_it_is_gone_to(page):
    view = page.locator("canvas[aria-label='camera cam01']")

    def shown(key):
        page.keyboard.press(key)
        page.wait_for_selector("body[aria-busy=false]")
        page.wait_for_function("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")
        return view.screenshot()

    page.keyboard.press("0")
    first = shown("Home")
    assert row(page) == 0
    last = shown("End")
    assert last != first
    assert shown("Home") == first
