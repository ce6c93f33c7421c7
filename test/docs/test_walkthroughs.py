"""The commands of every page, run in their order as they stand there, on short recordings (`helpers.docs.walkthrough.py`).

The tutorial and the README run on the first images of the sample, with the edits that they ask for.
"""

import itertools
import json
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from benchmark.suite.house import tutorial_commands
from helpers.cameras import phone_films
from helpers.docs.commands import CHANGED, NOT_RUN, is_run, why_not_run
from helpers.docs.given import GIVEN, shipped_files
from helpers.docs.pages import PAGES, ROOT, Block, Command, blocks_of, commands_of, mentions_of
from helpers.docs.place import Place, Shelf
from helpers.docs.walkthrough import Walkthrough
from helpers.sources.sample import sample_or_skip
from helpers.sources.weights import weights_or_skip
from tracker_node.cli.main import main
from tracker_node.loaders.rig.rig_yaml import load_rig

N_IMAGES = 6
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
WITH_SAMPLE = ("README.md", "docs/tutorial.md")
PHONES = "With phones"  # the section of the tutorial that has videos of its own
COMMANDS = [command for page in PAGES for command in commands_of(page)]


@pytest.fixture(scope="session")
def shelf(tmp_path_factory) -> Shelf:
    return Shelf(tmp_path_factory.mktemp("shelf"))


@pytest.fixture
def walkthrough(tmp_path, monkeypatch, shelf, ros_domain_id) -> Iterator[Walkthrough]:
    """In an empty folder, which is the current one."""
    monkeypatch.chdir(tmp_path)
    values = {"venv": sys.prefix, "domain": str(ros_domain_id)}
    walk = Walkthrough(Place(tmp_path, shelf, values))
    yield walk
    walk.close()


@pytest.mark.long
@pytest.mark.parametrize("page", [page for page in PAGES if page not in WITH_SAMPLE and any(map(is_run, commands_of(page)))])
def test_page(page, walkthrough):
    walkthrough.follow(page)
    assert walkthrough.done == [command for command in commands_of(page) if is_run(command)]


@pytest.mark.parametrize("command", COMMANDS, ids=str)
def test_every_command_is_run_or_listed_with_a_check_in_its_place(command, repository):
    entry = why_not_run(command)
    assert (entry is None) == is_run(command), f"{command}: neither run nor listed in test/helpers/docs/commands.py"
    if entry is not None:
        entry.check(command)
        assert (repository / entry.tests).is_file(), entry.tests


def test_a_command_that_is_neither_is_noticed(walkthrough):
    unknown = Command("docs/index.md", "", "cowsay moo")
    assert not is_run(unknown) and why_not_run(unknown) is None
    with pytest.raises(AssertionError, match="neither run nor listed"):
        walkthrough.do(unknown)
    with pytest.raises(AssertionError, match="--fast"):
        walkthrough.do(Command("docs/index.md", "", "tracker_node track --fast"))


def test_all_that_runs_is_ended_though_one_does_not_end_well(walkthrough):
    ended = []

    @contextmanager
    def running(name: str) -> Iterator[None]:
        yield
        ended.append(name)
        assert name != "second", "not ended well"

    for name in ("first", "second", "third"):
        walkthrough._start(name, running(name))
    with pytest.raises(AssertionError, match="not ended well"):
        walkthrough.close()
    assert ended == ["third", "second", "first"]


def test_what_pages_write_into_the_shipped_files_stays_with_them(walkthrough, repository):
    shipped_files(walkthrough.place)
    assert Path("config/models/human.yaml").is_file()
    assert not Path("config/models/human.yaml").resolve().is_relative_to(repository)


def test_the_tables_have_no_line_too_many():
    assert not [entry.pattern for entry in NOT_RUN if not any(entry.fits(command) for command in COMMANDS)]
    assert not [change.pattern for change in CHANGED if not any(re.search(change.pattern, c.text) for c in COMMANDS)]
    sections = {(command.page, command.section) for command in COMMANDS}
    assert not [place for place in GIVEN if place not in sections]


@pytest.mark.parametrize("page", PAGES)
def test_whole_commands_within_sentences_stand_in_a_block_somewhere(page):
    """Where they are run; whole is what has three words or more behind the program, and no gap."""
    shown = {command.text for command in COMMANDS}
    for mention in mentions_of(page):
        words = mention.split()
        if words[0] == "tracker_node" and len(words) > 3 and not re.search(r"<|\.\.\.|\b[A-Z]{2,}", mention):
            assert mention in shown or any(re.match(entry.pattern, mention) for entry in NOT_RUN), mention


@pytest.mark.parametrize("page", PAGES)
def test_only_shell_blocks_have_commands(page):
    for block in blocks_of(page):
        assert block.commands or not re.search(r"^\s*tracker_node ", block.text, re.MULTILINE), block


@pytest.fixture(scope="module")
def sample() -> dict[str, Path]:
    """Files of the sample, if they are on this machine."""
    return sample_or_skip()


RESAMPLED, RESAMPLED_SIZE = np.array([[1.0074, 0.0, 0.0], [0.0, 1.0074, -7.2]]), (1080, 1920)
"""Two of the videos are not in the pixels of the calibration: see docs/tutorial.md."""


def write_start_of(video: Path, target: Path, size: tuple[int, int] | None = None, pixel_map: np.ndarray | None = None) -> None:
    """The first images of a video, resampled to a size; with a map to the pixels of the calibration, in those."""
    target.parent.mkdir(parents=True, exist_ok=True)
    source = cv2.VideoCapture(str(video))
    width, height = size or (int(source.get(cv2.CAP_PROP_FRAME_WIDTH)), int(source.get(cv2.CAP_PROP_FRAME_HEIGHT)))
    written = cv2.VideoWriter(str(target), cv2.VideoWriter_fourcc(*"mp4v"), source.get(cv2.CAP_PROP_FPS), (width, height))
    for _ in range(N_IMAGES):
        image = source.read()[1]
        if pixel_map is None:
            written.write(cv2.resize(image, (width, height)))
        else:
            image = cv2.resize(image, RESAMPLED_SIZE)
            written.write(cv2.warpAffine(image, pixel_map, (width, height), borderMode=cv2.BORDER_REPLICATE))
    written.release()


def write_refined(sample: dict[str, Path], target: Path) -> None:
    """The calibration with the pose that the third camera had in the recording, where it is 23 px off."""
    rig, refined = target.with_suffix(".yaml"), target.with_suffix(".refined.yaml")
    for verb in (
        ["rig", "import", "--pose2sim", str(sample["calibration.toml"]), "-o", str(rig)],
        ["calibrate", "refine", "--rig", str(rig), "--points2d", str(sample["points2d.zip"]), "-o", str(refined)],
        ["rig", "export", str(refined), "--to", "pose2sim", "-o", str(target)],
    ):
        assert main(verb) == 0


def edits_of_the_tutorial(sample: dict[str, Path]) -> Callable[[Block], None]:
    """What is done by hand between the commands: videos cut short, entries of rigs, the file of the recording."""
    rig = None

    def after(block: Block) -> None:
        nonlocal rig
        written = [match[1] for match in re.finditer(r"-o (mine\S*\.yaml)", block.text)]
        rig = Path(written[-1]) if written else rig
        if block.text.startswith("tracker_node sample"):
            cut_short(sample)
        elif re.match(r" *background:", block.text):
            assert rig is not None
            edited(rig, block.text)
        elif block.text.startswith("rig: "):
            Path("recording.yaml").write_text(block.text)

    return after


def cut_short(sample: dict[str, Path]) -> None:
    """Short videos, and stills as ``calibrate background`` looks for them, in the videos' pixels, in the current folder."""
    for name in CAMERAS:
        write_start_of(sample[f"videos/{name}.mp4"], Path(f"videos/{name}.mp4"))
        video = cv2.VideoCapture(f"videos/{name}.mp4")
        size = int(video.get(cv2.CAP_PROP_FRAME_WIDTH)), int(video.get(cv2.CAP_PROP_FRAME_HEIGHT))
        still = cv2.resize(cv2.imread(f"stills/{name}.png"), size)
        cv2.imwrite(f"stills/{name[:3]}_{name[3:]}.png", still)


def edited(rig: Path, block: str) -> None:
    """What the tutorial asks for to be added to each camera of a rig."""
    values = yaml.safe_load(rig.read_text())
    background = yaml.safe_load(block)["background"]
    for number, camera in enumerate(values["cameras"].values(), 1):
        camera["background"] = background.replace("01", f"{number:02}")
    rig.write_text(yaml.safe_dump(values))


@pytest.mark.long
def test_the_tutorial(sample, walkthrough):
    walkthrough.follow("docs/tutorial.md", edits_of_the_tutorial(sample), lambda section: section != PHONES)
    assert walkthrough.done == [c for c in commands_of("docs/tutorial.md") if is_run(c) and c.section != PHONES]
    assert all(Path(run, "report.html").is_file() for run in ("run1", "run2", "run3"))
    assert Path("live/bag/metadata.yaml").is_file()


@pytest.mark.long
def test_phones(sample, walkthrough, tmp_path):
    """Videos of a real man and of a drawn board, cut as phones would that are started one by one, with claps in their sound."""
    weights_or_skip()
    pytest.importorskip("av", reason="the extra sound is not installed")
    true = phone_films.write_films(sample, tmp_path, tmp_path / "sample")

    def after(block: Block) -> None:
        if block.language == "yaml":
            Path("phones.yaml").write_text(block.text)

    walkthrough.follow("docs/tutorial.md", after, lambda section: section == PHONES)
    assert walkthrough.done == commands_with_phones()
    rig, timed = load_rig("rig.yaml"), load_rig("rig_timed.yaml")
    late = {camera.name: 1e-9 * camera.time_offset_ns for camera in timed}
    for name, images in phone_films.LATE_IMAGES.items():
        assert late[name] - late["right"] == pytest.approx(images / phone_films.RATE_HZ, abs=0.005)
    for a, b in itertools.combinations(rig.names, 2):  # distances are the same in any world
        apart, expected = (float(np.linalg.norm(r[a].center - r[b].center)) for r in (rig, true))
        assert apart == pytest.approx(expected, abs=0.12), (a, b)
    summary = json.loads(Path("run/run.json").read_text())
    assert summary["image_sets"] >= 80 and summary["status_counts"].get("LOST", 0) == 0
    assert Path("run/report.html").is_file() and Path("run/report.pdf").is_file()


def commands_with_phones() -> list[Command]:
    return [command for command in commands_of("docs/tutorial.md") if command.section == PHONES]


def test_phones_take_five_commands():
    assert 0 < tutorial_commands(ROOT) == len(commands_with_phones()) <= 5


@pytest.mark.long
def test_the_readme(sample, walkthrough, tmp_path):
    """Its files have other names; all videos have the pixels of the calibration, and the third camera stands where it says."""
    write_refined(sample, tmp_path / "Calib.toml")
    shutil.copyfile(sample["truth.trc"], tmp_path / "first.trc")
    for name in CAMERAS:
        named = f"{name[:3]}_{name[3:]}"
        pixel_map = RESAMPLED if name in ("cam01", "cam02") else None
        write_start_of(sample[f"videos/{name}.mp4"], tmp_path / f"videos/{named}.mp4", (1088, 1920), pixel_map)
        (tmp_path / "empty").mkdir(exist_ok=True)
        shutil.copyfile(sample[f"stills/{name}.png"], tmp_path / f"empty/{named}.png")
    description = "rig: rig.yaml\nmodel: person.yaml\ninitial_state: start.yaml\noutput: described\nimages: {shrink: 4}\n"
    (tmp_path / "recording.yaml").write_text(description)
    walkthrough.follow("README.md")
    assert walkthrough.done == [command for command in commands_of("README.md") if is_run(command)]
    assert (tmp_path / "out/run1/states.csv").is_file() and (tmp_path / "described/bag/metadata.yaml").is_file()
