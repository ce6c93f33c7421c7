"""What the documentation shows can be read, and what it points to is there."""

import argparse
import ast
import importlib
import json
import re
import shlex
import tomllib

import pytest

from helpers.docs.commands import parsed, parser_of
from helpers.docs.pages import PAGES, commands_of, mentions_of
from tracker_node.cli import main
from tracker_node.cli.main import verbs
from tracker_node.evaluation.masks.reference import load_reference_masks
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.loaders.rig.rig_yaml import load_rig, read_rig_file
from tracker_node.model.humans.human import gait_human, human_model
from tracker_node.model.kinematic_chain import N_ROOT_DOF
from tracker_node.runs.config_file import load_config


def example(repository, tmp_path, section: str, language: str, page: str = "formats.md"):
    """The code block of a section of a page, as a file."""
    text = (repository / "docs" / page).read_text()
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
    assert load_model(example(repository, tmp_path, "An object", "yaml", "bodies.md")).n_dof == N_ROOT_DOF
    human = human_model()
    state = load_state(example(repository, tmp_path, "state.yaml", "yaml"), human)
    assert state.joint_positions[human.chain.axis_index("left_knee_flexion")] > 0.3
    config = load_config(example(repository, tmp_path, "tracker.yaml", "yaml"))
    assert (config.region.inlier_px, config.limb_search.poses) == (3.0, 200)
    for named in ("start.yaml", "person.yaml", "table.yaml", "truth.trc", "pose_landmark_heavy.tflite"):
        (tmp_path / named).touch()
    (tmp_path / "tracker.yaml").touch()
    (tmp_path / "arm.csv").touch()
    (tmp_path / "masks.json").touch()
    recording = load_recording(example(repository, tmp_path, "recording.yaml", "yaml"))
    assert (recording.images.resize, recording.evaluate.targets) == ((544, 960), ("mpjpe_mm<=60",))
    assert set(load_reference_masks(example(repository, tmp_path, "masks.json", "json"))) == {"cam01", "cam03"}
    assert "metrics" in json.loads(example(repository, tmp_path, "Metrics files", "json").read_text())


def test_limits_on_the_page_are_those_of_the_human(repository):
    text = (repository / "docs" / "formats.md").read_text()
    section = re.search(r"^## The human\n(.*?)^## ", text, re.MULTILINE | re.DOTALL)[1]
    table = re.findall(r"^\| (`[^|]*) \| [^|]* \| ([^|]*) \|$", section, re.MULTILINE)
    documented = {}
    for names, limits in table:
        for name, limit in zip(re.findall(r"`([^`]+)`", names), limits.split(","), strict=True):
            low, high = (-float(limit.strip()[1:]), float(limit.strip()[1:])) if "±" in limit else map(float, limit.split(".."))
            for side in ("left", "right") if "*" in name else ("",):
                documented[name.replace("*", side)] = (low, high)
    human = gait_human()
    degrees = {a.name: (round(a.lower * 57.29577951308232, 6), round(a.upper * 57.29577951308232, 6)) for a in human.chain.axes}
    assert documented == degrees


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(repository, page):
    for target, anchor in re.findall(r"\]\(([^)#\s]*)(#[^)]*)?\)", (repository / page).read_text()):
        if target.startswith("https://"):
            continue
        file = (repository / page).parent / target if target else repository / page
        assert file.is_file(), target
        if anchor:
            headings = [
                re.sub(r"[^\w\- ]", "", h).strip().lower().replace(" ", "-")
                for h in re.findall(r"^#+ (.*)$", file.read_text(), re.M)
            ]
            assert anchor[1:] in headings, (target, anchor)


def commands(page: str, program: str) -> tuple[list[list[str]], list[list[str]]]:
    """Arguments of ``program`` where a page shows it in a block of code, and where it mentions it in a sentence."""
    start = re.compile(rf"(?:[A-Z_]+=\S+ )?(?:ros2 run )?(?:[\w./]*/bin/)?{program}(?= |$)")
    lines = [command.text for command in commands_of(page)]
    shown = [shlex.split(line[start.match(line).end() :]) for line in lines if start.match(line)]
    mentioned = [span[start.match(span).end() :].split() for span in mentions_of(page) if start.match(span)]
    return [c for c in shown if c], [c for c in mentioned if c and "<" not in c[0]]


def option_strings(parser: argparse.ArgumentParser) -> set[str]:
    names = set(parser._option_string_actions)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            names.update(*(option_strings(sub) for sub in action.choices.values()), action.choices)
    return names


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_the_pages_exist(page, capsys):
    shown, mentioned = commands(page, "tracker_node")
    for arguments in shown:
        parsed(arguments)
    for verb, *rest in mentioned:
        if verb in ("--help", "--version"):
            continue
        known = option_strings(parser_of(verb))
        for word in rest:
            assert not word.startswith("-") or word.split("=")[0] in known, (verb, word)
        if verb in ("calibrate", "rig") and rest:
            assert rest[0] in known, rest[0]


@pytest.mark.parametrize("page", PAGES)
def test_make_targets_of_the_pages_exist(repository, page):
    makefile = (repository / "Makefile").read_text()
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    variables = set(re.findall(r"^([A-Z_]+) [:?]?=|\$\(([A-Z_]+)\)", makefile, re.MULTILINE))
    known = {name for pair in variables for name in pair}
    shown, mentioned = commands(page, "make")
    for arguments in shown + mentioned:
        for word in arguments:
            name, is_variable, _ = word.strip('"').partition("=")
            if is_variable:
                assert name in known, word
            elif re.fullmatch(r"[a-z-]+", name):
                assert name in targets, word
                break


@pytest.mark.parametrize("page", PAGES)
def test_files_that_the_pages_name_are_there(repository, page):
    folders = "tracker_node|docs|config|tools|benchmark|test|launch|requirements|msgs|resource|\\.ci"
    for name in re.findall(rf"(?<![\w./-])((?:{folders})/[\w./-]*\w)", (repository / page).read_text()):
        if not (repository / page).parent.joinpath(name).exists() and not name.startswith("config/reference"):
            assert (repository / name).exists(), name


def test_readme_shows_a_picture_that_is_quick_to_load(repository):
    for picture in re.findall(r"!\[[^]]*\]\(([^)]*)\)", (repository / "README.md").read_text()):
        assert (repository / picture).stat().st_size < 400_000


def test_architecture_draws_the_layers_that_the_import_contract_holds(repository):
    contracts = tomllib.loads((repository / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    text = (repository / "docs" / "architecture.md").read_text()
    drawn = text.split("```text\n", 1)[1].split("```", 1)[0].splitlines()
    assert [re.split(r"\s{2,}", line)[0] for line in drawn] == contracts[0]["layers"]
    packages = {folder.parent.name for folder in (repository / "tracker_node").glob("*/__init__.py")}
    modules = {"closing", "errors", "parallel", "version"}
    assert packages | modules == {name for layer in contracts[0]["layers"] for name in layer.split(" | ")}


def test_every_page_begins_with_what_its_reader_wants(repository):
    for page in (repository / "docs").glob("*.md"):
        text = page.read_text()
        after_title = text.split("\n# ", 1)[-1] if text.startswith("<!-- Generated") else text
        assert after_title.split("\n\n", 1)[1].startswith("You want "), page.name


def test_every_package_has_a_contract_of_its_inside(repository):
    contracts = tomllib.loads((repository / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    inside = {each["containers"][0] for each in contracts if each["name"] == f"Inside {each.get('containers', [''])[0][13:]}"}
    packages = {f"tracker_node.{folder.parent.name}" for folder in (repository / "tracker_node").glob("*/__init__.py")}
    assert packages | {f"tracker_node.tracking.{name}" for name in ("color", "keypoints", "region")} <= inside
    assert all(each.get("exhaustive") for each in contracts if each["type"] == "layers"), "a module may be in no layer"


def test_every_package_says_what_lives_there_and_where_to_begin(repository):
    for file in (repository / "tracker_node").rglob("__init__.py"):
        text = ast.get_docstring(ast.parse(file.read_text())) or ""
        package = file.parent.relative_to(repository / "tracker_node").as_posix()
        assert "Begin with" in text or package in (".", "ros/conversions") or package.startswith("cli/")
        named = re.findall(r"Begin with `([\w.]+)`", text)
        for name in named:
            place = file.parent / name.replace(".", "/")
            assert place.is_dir() or place.with_suffix(".py").exists(), f"{file}: {name}"


@pytest.mark.parametrize("verb", verbs())
def test_help_of_every_verb_has_a_description_and_examples_that_parse(verb, capsys):
    module = importlib.import_module(main.module_of(verb))
    with pytest.raises(SystemExit) as leaving:
        main.main([verb, "--help"])
    assert leaving.value.code == 0
    printed = capsys.readouterr().out
    assert module.SUMMARY in printed and "\nexample:\n" in printed
    lines = [line.split() for line in module.EXAMPLE.strip().splitlines()]
    assert any(line[:2] == ["tracker_node", verb] for line in lines)
    for line in module.EXAMPLE.strip().splitlines():
        parsed(shlex.split(line)[1:])


SUBVERBS = [(verb, what) for verb in verbs() for what in getattr(importlib.import_module(main.module_of(verb)), "SUBVERBS", ())]


@pytest.mark.parametrize(("verb", "what"), SUBVERBS, ids=lambda each: getattr(each, "name", each))
def test_help_of_every_subverb_has_a_description_and_examples_that_parse(verb, what, capsys):
    with pytest.raises(SystemExit) as leaving:
        main.main([verb, what.name, "--help"])
    assert leaving.value.code == 0
    printed = capsys.readouterr().out
    assert "\nexample:\n" in printed
    assert " ".join(what.summary.split())[:60] in " ".join(printed.split())
    lines = [line.split() for line in what.example.strip().splitlines()]
    assert any(line[:3] == ["tracker_node", verb, what.name] for line in lines)
    for line in what.example.strip().splitlines():
        parsed(shlex.split(line)[1:])


def undescribed(parser: argparse.ArgumentParser) -> list[str]:
    """Arguments without a help text, of a parser and its sub-parsers."""
    names = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            names += [name for sub in action.choices.values() for name in undescribed(sub)]
        elif not action.help:
            names.append(f"{parser.prog} {action.dest}")
    return names


@pytest.mark.parametrize("verb", verbs())
def test_every_argument_is_described(verb):
    assert undescribed(parser_of(verb)) == []
