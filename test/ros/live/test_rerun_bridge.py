"""The bridge to Rerun's viewer: what arrives at a real receiver of Rerun is what the tracker has said."""

import os
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="the extra rerun is not installed")

import rerun_cli
from tracker_msgs.msg import TrackedState

from helpers.cameras import two_people
from helpers.rerun_file import RerunFile
from helpers.ros.graph import stamps
from tracker_node.cli.main import main
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State


@pytest.fixture
def viewer(tmp_path):
    """Rerun's own program, which takes what a viewer takes, on the loopback alone, and writes it to a file."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    file = tmp_path / "received.rrd"
    (tmp_path / ".config/rerun").mkdir(parents=True)
    (tmp_path / ".config/rerun/analytics.json").write_text('{"analytics_enabled": false}')
    program = Path(rerun_cli.__file__).parent / "rerun"  # the one in bin/ starts this, and leaves it behind when it is ended
    options = ["--bind", "127.0.0.1", "--port", str(port), "--save", str(file)]
    process = subprocess.Popen([program, *options], env={**os.environ, "HOME": str(tmp_path)})
    until_s = time.monotonic() + 30.0
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
            break
        except OSError:
            assert process.poll() is None and time.monotonic() < until_s, "the receiver does not listen"
            time.sleep(0.1)
    yield f"rerun+http://127.0.0.1:{port}/proxy", file, process
    process.kill()
    process.wait()


def follow(probe, launch, rig, body: list, bridge: list, topics: dict[str, str]) -> tuple[dict[str, list], object]:
    """States by topic of a recording that is tracked while the bridge listens, and the ended bridge."""
    states = {topic: probe.listen(TrackedState, topic) for topic in topics.values()}
    watching = launch("rerun_bridge", "--rig", rig, *body[:2], *bridge)
    tracker = ["--rig", rig, *body, "--lossless", "--wait-for", *(f"{name}state=2" for name in topics)]
    launch("tracker", *tracker)
    infos = probe.node.count_subscribers
    probe.spin_until(lambda: all(infos(f"/{topic}") >= 2 for topic in states), "the bridge to listen")
    listening = "1" if bridge[-1] == "0" else "2"  # the bridge takes no images at a rate of 0
    cameras = launch("camera_ingest", "--rig", rig, "--wait-for-subscribers", listening, "--no-frame-skip")
    n = len(list((Path(rig).parent / "cam1").glob("*.png")))
    probe.spin_until(lambda: all(len(got) == n for got in states.values()), f"{n} states of each body")
    assert cameras.wait() == 0, cameras.err
    time.sleep(1.0)  # the bridge has taken the last ones
    watching.interrupt()
    assert watching.wait() == 0, watching.err
    return states, watching


def assert_shown(file: RerunFile, body: str, model, messages: list) -> None:
    """Poses of all links, angles and statuses are those of the messages."""
    for k, link in enumerate(model.chain.links):
        entity = f"/world/bodies/{body}/{link}"
        np.testing.assert_array_equal(file.over_time(entity, "Transform3D:translation")[0], stamps(messages))
        Ts = np.array([Configuration(model, State.from_values(np.array(m.values))).Ts_world_link[k] for m in messages])
        np.testing.assert_allclose(file.array(entity, "Transform3D:translation"), Ts[:, :3, 3], rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(file.array(f"/residual/{body}", "Scalars:scalars"), [m.residual for m in messages])
    assert len(file.array(f"/status/{body}", "StateChange:state")) == len(messages)


def test_a_viewer_gets_what_the_tracker_says(recording, probe, launch, viewer):
    address, received, process = viewer
    body = ["--model", recording / "model.yaml", "--initial-state", recording / "state.yaml"]
    bridge = ["--connect", address, "--image-rate", "1000"]
    states, watching = follow(probe, launch, recording / "rig.yaml", body, bridge, {"": "tracker/state"})
    size = -1
    while size != (size := received.stat().st_size):  # until nothing more comes
        time.sleep(1.0)
    process.terminate()
    process.wait(30.0)
    file, model = RerunFile(received), load_model(recording / "model.yaml")
    messages = states["tracker/state"]
    assert_shown(file, "body", model, messages)
    assert "12 states shown" in watching.out
    centers = np.array(file.over_time("/world/bodies/body/uncertainty", "Ellipsoids3D:centers")[1])
    assert len(centers) == 12
    for camera in ("cam1", "cam2", "cam3"):
        images = set(file.over_time(f"/world/cameras/{camera}/image", "EncodedImage:blob")[0].tolist())
        outlined = set(file.over_time(f"/world/cameras/{camera}/body", "LineStrips2D:strips")[0].tolist())
        assert outlined and outlined <= images <= set(stamps(messages))


def test_a_file_gets_several_bodies(probe, launch, tmp_path):
    recording = two_people.write_recording(tmp_path / "two", 3)
    topics = {f"{name}/": f"tracker/{name}/state" for name in two_people.MODELS}
    live = tmp_path / "live.rrd"
    states, _ = follow(
        probe, launch, recording.parent / "rig.yaml", ["--bodies", recording], ["--output", live, "--image-rate", "0"], topics
    )
    file = RerunFile(live)
    for name, model in two_people.MODELS.items():
        assert_shown(file, name, model, states[f"tracker/{name}/state"])
    assert not any(entity.endswith("/image") for entity in file.entities)


def test_mistakes_are_said(recording, launch, probe, tmp_path, capsys):
    rig, model = str(recording / "rig.yaml"), str(recording / "model.yaml")
    for options, said in [
        (["--connect", "localhost"], "'--connect': expected an address such as rerun+http://127.0.0.1:9876/proxy"),
        (["--image-rate", "-1"], "'--image-rate': expected 0 to 1000"),
        (["--output", str(tmp_path)], "expected a file to write, got a folder"),
    ]:
        assert main(["rerun_bridge", "--rig", rig, "--model", model, *options]) == 2
        assert said in capsys.readouterr().err
    other = launch("rerun_bridge", "--rig", rig, "--model", "config/models/human.yaml", "--output", tmp_path / "other.rrd")
    publisher = probe.node.create_publisher(TrackedState, "tracker/state", 10)
    probe.spin_until(publisher.get_subscription_count, "the bridge to listen")
    publisher.publish(TrackedState(model="arm", dof_names=["root_x"], values=[0.5], status=1))
    assert other.wait() == 2 and "error: " in other.err and "degrees of freedom of tracker/state" in other.err
