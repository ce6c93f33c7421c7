"""What the documentation shows can be read, and what it points to is there."""

import json
import re

import pytest

from tracker_node.evaluation.config_file import load_config
from tracker_node.evaluation.reference_masks import load_reference_masks
from tracker_node.loaders.model_yaml import load_model
from tracker_node.loaders.rig_yaml import load_rig, read_rig_file
from tracker_node.loaders.state_yaml import load_state
from tracker_node.model.human import human_model
from tracker_node.model.kinematic_chain import N_ROOT_DOF


def example(repository, tmp_path, section: str, language: str):
    """The code block of a section of formats.md, as a file."""
    text = (repository / "docs" / "formats.md").read_text()
    body = re.search(rf"^## {re.escape(section)}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)[1]
    block = re.search(rf"```{language}\n(.*?)```", body, re.DOTALL)[1]
    path = tmp_path / section
    path.write_text(block)
    return path


def test_examples_of_the_formats_are_valid(repository, tmp_path):
    rig = example(repository, tmp_path, "rig.yaml", "yaml")
    assert load_rig(rig).names == ("cam01",)
    assert read_rig_file(rig).lights[0].kind == "spot"
    model = load_model(example(repository, tmp_path, "model.yaml", "yaml"))
    assert model.chain.dof_names[N_ROOT_DOF:] == ("swivel", "lift", "nod")
    human = human_model()
    state = load_state(example(repository, tmp_path, "state.yaml", "yaml"), human)
    assert state.joint_positions[human.chain.axis_index("left_knee_flexion")] > 0.3
    config = load_config(example(repository, tmp_path, "tracker.yaml", "yaml"))
    assert (config.evidence.canny_high, config.optimizer.max_iterations) == (120.0, 8)
    assert set(load_reference_masks(example(repository, tmp_path, "masks.json", "json"))) == {"cam01", "cam03"}
    assert "metrics" in json.loads(example(repository, tmp_path, "Figures", "json").read_text())


def test_limits_in_the_conventions_are_those_of_the_human(repository):
    text = (repository / "docs" / "conventions.md").read_text()
    table = re.findall(r"^\| (`[^|]*) \| [^|]* \| ([^|]*) \|$", text[text.index("## The human") :], re.MULTILINE)
    documented = {}
    for names, limits in table:
        for name, limit in zip(re.findall(r"`([^`]+)`", names), limits.split(","), strict=True):
            low, high = (-float(limit.strip()[1:]), float(limit.strip()[1:])) if "±" in limit else map(float, limit.split(".."))
            for side in ("left", "right") if "*" in name else ("",):
                documented[name.replace("*", side)] = (low, high)
    human = human_model()
    degrees = {a.name: (round(a.lower * 57.29577951308232, 6), round(a.upper * 57.29577951308232, 6)) for a in human.chain.axes}
    assert documented == degrees


@pytest.mark.parametrize("page", ["formats.md", "conventions.md", "nodes.md"])
def test_links_lead_somewhere(repository, page):
    text = (repository / "docs" / page).read_text()
    for target in re.findall(r"\]\(([^)#\s]*)(#[^)]*)?\)", text):
        file = repository / "docs" / target[0] if target[0] else repository / "docs" / page
        assert file.is_file(), target
        if target[1]:
            headings = [
                re.sub(r"[^\w\- ]", "", h).strip().lower().replace(" ", "-")
                for h in re.findall(r"^#+ (.*)$", file.read_text(), re.M)
            ]
            assert target[1][1:] in headings, target
