"""The command: a fabricated run of known error, images and masks that the model fits exactly."""

import io
import json
import re
from argparse import Namespace
from base64 import b64decode
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.bodies.stick_person import Motion, motion, write_run, write_state_bag, write_truth
from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.cli import evaluate as evaluate_verb
from tracker_node.cli.arguments.recording import evaluate_recording
from tracker_node.cli.main import main, parser_of
from tracker_node.evaluation.run_review import unobservable_text
from tracker_node.loaders.bag.message_types import TRACKED_STATE, message_of
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.recording_yaml import RecordingFile
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.configuration import Configuration
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.runs.messages import IMAGE, image

N = 8
RATE_HZ = 60.0


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """Run, truth 30 mm beside it, model, rig with images and stills, masks by hand and by difference."""
    folder, tracked = tmp_path_factory.mktemp("files"), motion(N)
    write_run(folder / "run", tracked)
    write_state_bag(folder / "run" / "bag", tracked)
    write_state_bag(folder / "live", tracked)
    write_truth(folder / "truth.csv", tracked, moved_m=0.03)
    dump_model(tracked.model, folder / "model.yaml")
    rig = _rig()
    write_rig_file(rig_file_of(rig), folder / "rig.yaml")
    _write_images(folder, tracked, rig)
    whole = [0, 0, 479, 0, 479, 359, 0, 359]  # the whole image: the IoU is the share that the body covers
    masks = {
        "cam01": {"image_size": [480, 360], "polygons": {"2": [whole], "5": [whole], "99": [whole]}},
        "cam02": {"image_size": [480, 360], "still": ""},
    }
    (folder / "masks.json").write_text(json.dumps({"cameras": masks}))
    return folder


def _rig() -> CameraRig:
    lens = CameraModel(480, 360, np.array([[300.0, 0.0, 239.5], [0.0, 300.0, 179.5], [0.0, 0.0, 1.0]]))
    cameras = []
    for name, eye in (("cam01", (2.5, 0.5, 1.2)), ("cam02", (-0.5, 2.6, 1.0))):
        place = look_at(eye, (0.05, 0.0, 0.9), lens, name).T_world_cam
        cameras.append(Camera(name, lens, place, source=name, background=f"{name}_still.png"))
    return CameraRig(tuple(cameras))


def _write_images(folder: Path, tracked: Motion, rig: CameraRig) -> None:
    scene = cv2.GaussianBlur(np.random.default_rng(0).uniform(60, 230, (360, 480, 3)), (0, 0), 9).astype(np.uint8)
    for camera in rig:
        (folder / camera.name).mkdir()
        cv2.imwrite(str(folder / f"{camera.name}_still.png"), scene)
        for i, state in enumerate(tracked.states):
            image = scene.copy()
            image[render_mask(Configuration(tracked.model, state), camera) > 0] = (20, 20, 220)
            cv2.imwrite(str(folder / camera.name / f"{i:03d}.png"), image)


def evaluate(files: Path, run: str, output: Path, *more: str) -> int:
    arguments = ["evaluate", str(files / run), "--truth", str(files / "truth.csv"), "--model", str(files / "model.yaml")]
    return main([*arguments, "--rig", str(files / "rig.yaml"), "--name", "stick", "--output", str(output), *more])


def figures_of(output: Path) -> dict:
    return json.loads((output / "report.json").read_text())["metrics"]


@pytest.mark.parametrize("run", ["run", "live"])
def test_a_run_and_a_live_recording_give_the_same_figures(files, tmp_path, run, capsys):
    assert evaluate(files, run, tmp_path, "--lag", "0", "--masks", str(files / "masks.json")) == 0
    figures = figures_of(tmp_path)
    assert figures["stick.mpjpe_mm"] == pytest.approx(30.0)
    assert figures["stick.mpjpe_no_lag_correction_mm"] == pytest.approx(30.0)
    assert figures["stick.mpjpe_offset_free_world_mm"] == pytest.approx(0.0, abs=1e-6)
    assert 0.0 < figures["stick.mpjpe_offset_free_mm"] < 5.0  # the segments turn, the offset does not
    assert (figures["stick.lost_sets"], figures["stick.lost_limbs"], figures["stick.image_sets"]) == (0, 0, N)
    assert figures["stick.residual_px_cam02"] == pytest.approx(3.5)
    assert figures["stick.landmark_mm.left_wrist"] == pytest.approx(30.0)
    tracked, cameras = motion(N), _rig()
    covered = [np.mean(render_mask(tracked.configurations[i], cameras["cam01"]) > 0) for i in (2, 5)]
    assert figures["stick.iou_cam01"] == pytest.approx(np.mean(covered))
    assert figures["stick.iou_cam02"] > 0.8
    assert "stick.mpjpe_mm" in capsys.readouterr().out


def test_progress_of_several_threads_is_a_line_each(files, tmp_path, monkeypatch):
    """A line and its end that are written one after the other have another thread's line between them."""
    writes = []

    class Console(io.StringIO):
        def write(self, text: str) -> int:
            writes.append(text)
            return super().write(text)

    monkeypatch.setattr("sys.stderr", Console())
    assert evaluate(files, "run", tmp_path / "out", "--no-pdf") == 0
    assert {"images of cam01\n", "images of cam02\n"} <= set(writes) and "\n" not in writes


def test_the_report_holds_everything_itself(files, tmp_path):
    targets = ["--target", "mpjpe_mm<=60", "--target", "lost_sets>=1", "--target", "iou_cam09>=0.5"]
    assert evaluate(files, "run", tmp_path, "--lag", "0", "--masks", str(files / "masks.json"), "--pictures", "3", *targets) == 0
    page = (tmp_path / "report.html").read_text()
    assert not re.search(r"""<(img|script|link|iframe)[^>]*(src|href)=["'](?!data:|#)""", page)
    charts = json.loads(re.search(r'id="charts">(.*?)</script>', page).group(1))
    assert {"status", "errors", "joint_errors", "pck", "residuals_stick", "iterations", "times", "iou_stick"} <= set(charts)
    assert charts["errors"]["data"][0]["y"] == pytest.approx([30.0] * N)
    pictures = re.findall(r'src="data:image/jpeg;base64,([^"]+)"', page)
    assert len(pictures) == 2 * 3 * 2  # overlays and images through masks
    assert cv2.imdecode(np.frombuffer(b64decode(pictures[0]), np.uint8), cv2.IMREAD_COLOR).shape[0] == 420
    assert page.count('class="light good"') == 1 and page.count('class="light bad"') == 2
    assert "was not measured" in page
    assert "stick.mpjpe_offset_free_mm" in page


def test_without_a_rig_the_joints_are_judged_all_the_same(files, tmp_path):
    arguments = ["evaluate", str(files / "run"), "--truth", str(files / "truth.csv"), "--model", str(files / "model.yaml")]
    assert main([*arguments, "--output", str(tmp_path)]) == 0
    assert "run.mpjpe_mm" in figures_of(tmp_path)
    assert "Without a rig" in (tmp_path / "report.html").read_text()


def test_a_camera_whose_images_are_gone_is_named_and_the_others_go_on(files, tmp_path):
    rig = _rig()
    gone = Camera("cam01", rig["cam01"].model, rig["cam01"].T_world_cam, source=str(tmp_path / "gone.mp4"))
    there = Camera("cam02", rig["cam02"].model, rig["cam02"].T_world_cam, source=str(files / "cam02"))
    write_rig_file(rig_file_of(CameraRig((gone, there))), tmp_path / "rig.yaml")
    assert evaluate(files, "run", tmp_path, "--rig", str(tmp_path / "rig.yaml"), "--pictures", "2") == 0
    page = (tmp_path / "report.html").read_text()
    assert "gone.mp4" in page and "cam02, image 0" in page


def test_pictures_from_the_bag_where_the_rig_has_no_sources(files, tmp_path):
    tracked, rig = motion(N), _rig()
    write_state_bag(tmp_path / "live", tracked)
    with BagReader(tmp_path / "live") as reader:
        states = [(message.stamp_ns, message.data) for message in reader.messages(["/person/state"])]
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/tracker/state", TRACKED_STATE)
        for stamp, data in states:
            writer.write("/tracker/state", stamp, data)
        for i, stamp in enumerate(tracked.stamps_ns):
            picture = cv2.imread(str(files / "cam01" / f"{i:03d}.png"))
            writer.write_message("/lab/cam01/image_raw", int(stamp), message_of(IMAGE, image(int(stamp), "cam01", picture)))
    bare = CameraRig(tuple(Camera(camera.name, camera.model, camera.T_world_cam) for camera in rig))
    write_rig_file(rig_file_of(bare), tmp_path / "rig.yaml")
    masks = json.loads((files / "masks.json").read_text())["cameras"]
    (tmp_path / "masks.json").write_text(json.dumps({"cameras": {"cam01": masks["cam01"]}}))
    more = ["--rig", str(tmp_path / "rig.yaml"), "--masks", str(tmp_path / "masks.json"), "--lag", "0", "--pictures", "2"]
    arguments = ["evaluate", str(tmp_path / "bag"), "--truth", str(files / "truth.csv"), "--model", str(files / "model.yaml")]
    assert main([*arguments, *more, "--name", "stick", "--output", str(tmp_path)]) == 0
    page = (tmp_path / "report.html").read_text()
    assert "cam01, image 0" in page and "cam02, image 0" not in page
    assert "names no source" in page  # of cam02
    assert 0.0 < figures_of(tmp_path)["stick.iou_cam01"] < 0.5


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--lag", "late"], "--lag"),
        (["--lag", "nan"], "--lag"),
        (["--lag", "1e6"], "--lag"),
        (["--image-sets", "-5"], "--image-sets"),
        (["--first-image", "-1"], "--first-image"),
        (["--pictures", "-3"], "--pictures"),
        (["--target", "mpjpe_mm<=nan"], "--target"),
        (["--name", "another"], "--name"),
        (["--target", "mpjpe_mm=60"], "--target"),
        (["--truth", "nowhere.trc"], "nowhere.trc"),
        (["--masks", "nowhere.json"], "nowhere.json"),
        (["--rig", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_mistakes_are_one_line(files, tmp_path, capsys, more, message):
    assert evaluate(files, "run", tmp_path, *more) == 2
    errors = capsys.readouterr().err.strip().splitlines()
    assert message in errors[-1] and "error" in errors[-1]
    assert not (tmp_path / "report.json").exists()


def test_what_cannot_be_a_name_or_a_folder_is_said_before_anything_is_done(files, tmp_path, capsys):
    (tmp_path / "file").write_text("kept")
    run = ["evaluate", str(files / "run"), "--model", "nowhere.yaml"]
    for more, message in ((["--name", ""], "--name"), (["--output", str(tmp_path / "file")], str(tmp_path / "file")),
                          (["--output", str(tmp_path / "file" / "below")], str(tmp_path / "file"))):  # fmt: skip
        assert main([*run, *more]) == 2
        error = capsys.readouterr().err.strip()
        assert message in error and "\n" not in error
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"targets": ["mpjpe_mm=60"]}, "evaluate.targets"),
        ({"truth": ["truth.txt"]}, "truth.txt"),
        ({"masks": "rig.yaml"}, "rig.yaml"),
    ],
)
@pytest.mark.parametrize("verb", ["track", "pipeline"])
def test_what_a_recording_is_held_against_is_looked_at_before_it_is_tracked(files, tmp_path, capsys, verb, entry, message):
    for name in ("rig.yaml", "model.yaml"):
        (tmp_path / name).write_text((files / name).read_text())
    (tmp_path / "truth.txt").write_text("")
    said = {"rig": "rig.yaml", "model": "model.yaml", "output": "out", "evaluate": entry}
    (tmp_path / "recording.yaml").write_text(json.dumps(said))
    assert main([verb, str(tmp_path / "recording.yaml")]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error and "\n" not in error and not (tmp_path / "out").exists()


def test_without_truth_a_run_is_reported_all_the_same(files, tmp_path):
    more = ["--model", str(files / "model.yaml"), "--rig", str(files / "rig.yaml"), "--pictures", "2", "--no-pdf"]
    assert main(["evaluate", str(files / "run"), *more, "--output", str(tmp_path)]) == 0
    figures = figures_of(tmp_path)
    assert figures["run.residual_px"] == pytest.approx(2.5) and figures["run.total_ms_p95"] == pytest.approx(3.0)
    assert "run.mpjpe_mm" not in figures
    assert not (tmp_path / "report.pdf").exists() and "cam02, image 7" in (tmp_path / "report.html").read_text()


def test_runs_are_compared(files, tmp_path, capsys):
    more = ["--truth", str(files / "truth.csv"), "--model", str(files / "model.yaml"), "--no-pdf", "--csv", "--lag", "0"]
    assert main(["evaluate", str(files / "run"), str(files / "live"), *more, "--output", str(tmp_path)]) == 0
    figures = figures_of(tmp_path)
    assert figures["run.mpjpe_mm"] == pytest.approx(figures["live.mpjpe_mm"])
    summary = (tmp_path / "figures" / "summary.csv").read_text().splitlines()
    assert summary[0] == "metric,run,live,difference,,meaning,key"
    assert any(line.startswith("Joint error (MPJPE),30.0,30.0,0.0,mm") for line in summary)
    assert main(["evaluate", str(files / "run"), str(files / "live"), *more]) == 2
    assert "--output" in capsys.readouterr().err


def test_each_run_has_its_own_truth_or_one_for_all_which_is_said(files, tmp_path, capsys):
    write_truth(tmp_path / "other.csv", motion(N), moved_m=0.05)
    more = ["--model", str(files / "model.yaml"), "--no-pdf", "--lag", "0", "--output", str(tmp_path), "--pictures", "0"]
    both = ["evaluate", str(files / "run"), str(files / "live"), *more, "--truth", str(files / "truth.csv")]
    assert main([*both, "--truth", str(tmp_path / "other.csv")]) == 0
    figures = figures_of(tmp_path)
    assert (figures["run.mpjpe_mm"], figures["live.mpjpe_mm"]) == (pytest.approx(30.0), pytest.approx(50.0))
    assert "is that of all" not in capsys.readouterr().err
    assert main(both) == 0 and "truth.csv is that of all 2 runs" in capsys.readouterr().err
    assert figures_of(tmp_path)["live.mpjpe_mm"] == pytest.approx(30.0)


def test_states_and_joints_as_truth(files, tmp_path):
    tracked = motion(N)
    rows = write_run(tmp_path / "truth", tracked) / "states.csv"
    more = ["--model", str(files / "model.yaml"), "--no-pdf", "--lag", "0", "--output", str(tmp_path)]
    assert main(["evaluate", str(files / "run"), "--truth", str(rows), "--truth", str(files / "truth.csv"), *more]) == 0
    figures = figures_of(tmp_path)
    assert figures["run.mpjpe_mm"] == pytest.approx(30.0)  # of the joints' own file
    assert figures["run.dof_rms.left_elbow_x_deg"] == pytest.approx(0.0, abs=1e-9)


def test_coordinates_that_were_exported_are_truth(files, tmp_path):
    model, motion_file = ["--model", str(files / "model.yaml")], str(tmp_path / "run.mot")
    assert main(["export", str(files / "run"), *model, "--to", "mot", "--output", motion_file]) == 0
    more = [*model, "--no-pdf", "--lag", "0", "--pictures", "0", "--output", str(tmp_path)]
    assert main(["evaluate", str(files / "run"), "--truth", motion_file, *more]) == 0
    figures = figures_of(tmp_path)
    assert figures["run.mpjpe_mm"] == pytest.approx(0.0, abs=1e-3)
    assert figures["run.joint_angle_deg"] == pytest.approx(0.0, abs=1e-4)


def test_names_of_the_truth_that_are_no_landmarks_are_said(files, tmp_path, capsys):
    (tmp_path / "truth.csv").write_text((files / "truth.csv").read_text().replace("left_knee", "LKNE"))
    more = ["--model", str(files / "model.yaml"), "--no-pdf", "--pictures", "0", "--output", str(tmp_path)]
    assert main(["evaluate", str(files / "run"), "--truth", str(tmp_path / "truth.csv"), *more]) == 0
    assert "run: 1 of 14 markers are no landmarks of the body: LKNE\n" in capsys.readouterr().err


@pytest.mark.parametrize("has_joints", [True, False])
def test_an_export_whose_first_sets_were_lost_is_the_same_run(files, tmp_path, capsys, has_joints):
    tracked, model = motion(N), ["--model", str(files / "model.yaml")]
    late = str(write_run(tmp_path / "late", tracked, ["LOST"] * 3 + ["TRACKING"] * (N - 3)))
    if not has_joints:
        table = ["header", "inDegrees=no", "endheader", "time\tleft_elbow_x"]
        column = 6 + tracked.model.chain.dof_names[6:].index("left_elbow_x")
        rows = [(stamp * 1e-9, state.to_values()[column]) for stamp, state in zip(tracked.stamps_ns, tracked.states, strict=True)]
        (tmp_path / "late.mot").write_text("\n".join([*table, *(f"{time_s:.9f}\t{angle:.9f}" for time_s, angle in rows[3:])]))
    else:
        assert main(["export", late, *model, "--to", "mot", "--output", str(tmp_path / "late.mot")]) == 0
    more = [*model, "--no-pdf", "--lag", "0", "--pictures", "0", "--output", str(tmp_path)]
    assert main(["evaluate", late, "--truth", str(tmp_path / "late.mot"), *more]) == 0
    assert figures_of(tmp_path)["run.dof_rms.left_elbow_x_deg"] == pytest.approx(0.0, abs=1e-4)
    if has_joints:
        assert figures_of(tmp_path)["run.mpjpe_mm"] == pytest.approx(0.0, abs=1e-3)
        assert "by its own times, is put on image 3.0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--name", "a", "--name", "a"], "--name"),
        (["--name", "a"], "--name"),
        (["--truth", "a.csv", "--truth", "b.trc", "--truth", "c.trc"], "a.csv"),
        ([*["--truth", "a.trc"] * 3], "--truth: expected one file for all runs or 2, got 3"),
        (["--rig", "a", "--rig", "b", "--rig", "c"], "--rig"),
    ],
)
def test_what_does_not_fit_several_runs_is_one_line(files, tmp_path, capsys, more, message):
    runs = ["evaluate", str(files / "run"), str(files / "live"), "--model", str(files / "model.yaml")]
    assert main([*runs, "--output", str(tmp_path), *more]) == 2
    assert message in capsys.readouterr().err.strip().splitlines()[-1]


def test_without_a_model_it_asks_for_one(files, tmp_path, capsys):
    assert main(["evaluate", str(files / "run"), "--truth", str(files / "truth.csv")]) == 2
    assert "--model" in capsys.readouterr().err


def test_axes_may_be_named_as_calibrate_body_names_them():
    parser = parser_of("evaluate", evaluate_verb)
    for options, y_up in ((["--z-up"], False), (["--no-y-up"], False), (["--y-up"], True), ([], None)):
        assert parser.parse_args(["run", *options]).y_up is y_up


def test_what_the_images_do_not_tell_takes_a_sentence():
    """However many there are: five that last, and how many more."""
    untold = [{"what": f"joint_{i}", "sets": i} for i in range(1, 31)]
    (said,) = unobservable_text({"image_sets": 100, "unobservable": untold})
    assert "tell joint_30 (30 sets), joint_29" in said and "joint_26 (26 sets) and 25 other degrees of freedom" in said
    (short,) = unobservable_text({"image_sets": 100, "unobservable": untold[:10]})
    assert "tell joint_10 (10 sets) and 9 other" in short
    assert unobservable_text({"image_sets": 1, "unobservable": untold[:1]}) == [
        "The images do not always tell joint_1 (1 set): there they are guessed."
    ]


@pytest.mark.parametrize("cut", [{}, {"end": 5}, {"start": 3}, {"max_sets": 4}])
def test_image_sets_of_a_recording_are_those_of_all_of_it(monkeypatch, tmp_path, cut):
    given = []
    monkeypatch.setattr("tracker_node.cli.arguments.verbs.run_verb", lambda *arguments: given.append(arguments) or 0)
    recording = RecordingFile(rig="r", model="m", output="o", images={"end": 100}, evaluate={"image_sets": 100})
    args = Namespace(**{"model": "m", "rig": "r", "start": 0, "end": 100, "max_sets": None} | cut)
    assert evaluate_recording(recording, args, tmp_path, tmp_path) == 0
    assert ("--image-sets" in given[0]) == (not cut)
