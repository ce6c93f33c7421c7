"""Message definitions without ROS: the right text, the right hash, wherever the package is."""

import json
import sys
from pathlib import Path

import pytest

from tracker_node.loaders.bag import message_types
from tracker_node.loaders.bag.message_types import TRACKED_STATE, UnknownMessageTypeError, message_type, typestore_of


def test_own_definition_is_that_of_the_interface_package(repository: Path) -> None:
    source = (repository / "msgs/msg/TrackedState.msg").read_text()
    assert message_type(TRACKED_STATE).definition.startswith(source)
    assert "MSG: geometry_msgs/Quaternion\n" in message_type(TRACKED_STATE).definition


@pytest.mark.parametrize("name", [TRACKED_STATE, "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo", "std_msgs/msg/String"])
def test_hash_is_that_of_the_installed_package(name: str) -> None:
    package, _, short = name.split("/")
    path = Path(sys.prefix, "share", package, "msg", f"{short}.json")
    if not path.exists():
        pytest.skip(f"{package} is not installed in {sys.prefix}")
    hashes = {entry["type_name"]: entry["hash_string"] for entry in json.loads(path.read_text())["type_hashes"]}
    assert message_type(name).type_hash == hashes[name]


def test_types_of_other_packages_are_found_below_ament_prefixes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "share/zoo_msgs/msg"
    folder.mkdir(parents=True)
    (folder / "Animal.msg").write_text("std_msgs/Header header\nLeg[] legs\nstring<=10 name\n")
    (folder / "Leg.msg").write_text("float64[3] foot\n")
    with pytest.raises(UnknownMessageTypeError, match="AMENT_PREFIX_PATH"):
        message_type("zoo_msgs/msg/Animal")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    found = message_type("zoo_msgs/msg/Animal")
    assert found.type_hash.startswith("RIHS01_")
    store = typestore_of({found.name: found.definition})
    message = store.types["zoo_msgs/msg/Leg"](foot=[1.0, 2.0, 3.0])
    assert store.hash_rihs01(found.name) == found.type_hash
    assert message.foot == [1.0, 2.0, 3.0]


def test_a_missing_part_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "share/zoo2_msgs/msg"
    folder.mkdir(parents=True)
    (folder / "Cage.msg").write_text("farm_msgs/Hen[] hens\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    with pytest.raises(UnknownMessageTypeError, match="farm_msgs/msg/Hen"):
        message_type("zoo2_msgs/msg/Cage")


def test_a_bag_is_read_with_its_own_definitions() -> None:
    """A bag made with an older TrackedState keeps its meaning."""
    store = typestore_of({TRACKED_STATE: "uint8 status\n"})
    assert store.hash_rihs01(TRACKED_STATE) != message_types.message_type(TRACKED_STATE).type_hash
    assert store.deserialize_cdr(bytes([0, 1, 0, 0, 3]), TRACKED_STATE).status == 3
