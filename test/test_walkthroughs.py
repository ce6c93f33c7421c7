"""The commands of the tutorial and of the README, run in their order as they stand there, on the first images of the sample."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import pytest
import yaml

from tracker_node.loaders import wheel_cache
from tracker_node.loaders.sample_data import SAMPLES, fetch_sample

N_IMAGES = 6
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
# Nodes that wait for other programs' images, and what only shows or takes an hour; each has tests of its own.
NOT_RUN = ("tracker", "reproduce", "sample", "studio", "layouts")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def sample() -> dict[str, Path]:
    """Files of the sample, if they are on this machine."""
    cache = wheel_cache.cache_folder()
    full = all(wheel_cache._is_good(wheel_cache._cached(cache, member), member) for member in SAMPLES["balancing"])
    if not full and not os.environ.get("TRACKER_NETWORK"):
        pytest.skip(f"the sample is not in {cache}, and TRACKER_NETWORK is not set")
    return fetch_sample("balancing")


def write_start_of(video: Path, target: Path, size: tuple[int, int] | None = None) -> None:
    """The first images of a video, resampled to a size."""
    target.parent.mkdir(parents=True, exist_ok=True)
    source = cv2.VideoCapture(str(video))
    width, height = size or (int(source.get(cv2.CAP_PROP_FRAME_WIDTH)), int(source.get(cv2.CAP_PROP_FRAME_HEIGHT)))
    written = cv2.VideoWriter(str(target), cv2.VideoWriter_fourcc(*"mp4v"), source.get(cv2.CAP_PROP_FPS), (width, height))
    for _ in range(N_IMAGES):
        written.write(cv2.resize(source.read()[1], (width, height)))
    written.release()


def blocks_of(page: Path) -> list[str]:
    """The page's blocks of code in their order, fenced and indented, continued lines joined."""
    text = page.read_text().replace("\\\n", " ")
    found = re.finditer(r"^```\w*\n(.*?)^```|((?:^    [^\n]*\n)+)", text, re.MULTILINE | re.DOTALL)
    return [match[1] or re.sub(r"^    ", "", match[2], flags=re.MULTILINE) for match in found]


def run(line: str, folder: Path) -> None:
    """A command of a page; it has to end well."""
    arguments = shlex.split(line, comments=True)[1:]
    command = [sys.executable, "-m", "tracker_node.cli.main", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def edited(rig: Path, block: str) -> None:
    """What the tutorial asks for to be added to a rig: lines for the narrow cameras, or a plate for each."""
    values = yaml.safe_load(rig.read_text())
    addition = yaml.safe_load(block)
    for number, (name, camera) in enumerate(values["cameras"].items(), 1):
        if "plate" in addition:
            camera["plate"] = addition["plate"].replace("01", f"{number:02}")
        elif name in ("cam_01", "cam_02"):
            camera.update(addition)
    rig.write_text(yaml.safe_dump(values))


def test_the_tutorial(repository, sample, tmp_path):
    from tracker_node.calibration import balancing

    balancing.copy_files(sample, tmp_path)
    balancing.write_plates(tmp_path)
    for name in CAMERAS:  # as calibrate plate looks for them, and short
        shutil.copyfile(tmp_path / f"stills/{name}.png", tmp_path / f"stills/{name[:3]}_{name[3:]}.png")
        write_start_of(sample[f"videos/{name}.mp4"], tmp_path / f"videos/{name}.mp4")
    n_run, rig = 0, None
    for block in blocks_of(repository / "docs/tutorial.md"):
        for line in block.splitlines():
            if not line.startswith("tracker_node ") or line.split()[1] in NOT_RUN:
                continue
            if "--stills" in line:  # stills have the calibration's size, so this one is for a recording of one's own
                continue
            run(line, tmp_path)
            written = re.search(r"-o (mine\S*\.yaml)", line)
            rig = tmp_path / written[1] if written else rig
            n_run += 1
        if rig is not None and re.match(r" +(pixel_map|plate):", block):
            edited(rig, block)
        if block.startswith("rig: "):
            (tmp_path / "recording.yaml").write_text(block)
    assert n_run >= 9
    assert all((tmp_path / run / "report.html").is_file() for run in ("run1", "run2", "run3"))
    assert (tmp_path / "live/bag/metadata.yaml").is_file()


def test_the_readme(repository, sample, tmp_path):
    """Its files have other names, and all videos the size of the calibration."""
    shutil.copyfile(sample["calibration.toml"], tmp_path / "Calib.toml")
    shutil.copyfile(sample["truth.trc"], tmp_path / "first.trc")
    for name in CAMERAS:
        named = f"{name[:3]}_{name[3:]}"
        write_start_of(sample[f"videos/{name}.mp4"], tmp_path / f"videos/{named}.mp4", (1088, 1920))
        (tmp_path / "empty").mkdir(exist_ok=True)
        shutil.copyfile(sample[f"stills/{name}.png"], tmp_path / f"empty/{named}.png")
    description = "rig: rig.yaml\nmodel: person.yaml\ninitial_state: start.yaml\noutput: described\nimages: {shrink: 4}\n"
    (tmp_path / "recording.yaml").write_text(description)
    lines = [line for block in blocks_of(repository / "README.md") for line in block.splitlines()]
    commands = [line for line in lines if line.startswith("tracker_node ") and line.split()[1] not in NOT_RUN]
    for line in commands:
        run(line, tmp_path)
    assert len(commands) >= 7
    assert (tmp_path / "out/run1/states.csv").is_file() and (tmp_path / "described/bag/metadata.yaml").is_file()
