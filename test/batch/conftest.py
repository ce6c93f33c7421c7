"""A short recording, and trials made of it."""

from pathlib import Path

import pytest

from helpers.cameras.small_clip import Clip, make_clip

TRIALS = """output: out
common:
  rig: {folder}/rig.yaml
  model: {folder}/model.yaml
  config: {folder}/config.yaml
  initial_state: {folder}/start.yaml
subjects:
  anna: {{}}
trials:
  first: {{subject: anna}}
  second: {{subject: anna, images: {{end: 6}}}}
  third: {{images: {{start: 1}}}}
"""


@pytest.fixture(scope="session")
def clip(tmp_path_factory) -> Clip:
    return make_clip(tmp_path_factory.mktemp("clip"), 8)


@pytest.fixture
def trials_file(clip, tmp_path) -> Path:
    path = tmp_path / "trials.yaml"
    path.write_text(TRIALS.format(folder=clip.folder))
    return path
