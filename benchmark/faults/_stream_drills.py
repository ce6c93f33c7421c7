"""A stream of the network that asks for a password: whether that stays with us."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path

import cv2

from benchmark.faults._graph import Drill, Graph, Outcome, image_set_of
from helpers.sources.mjpeg_server import MjpegServer

SECRET = "s3cret-wOrd"
RATE_HZ = 10.0


def _password(graph: Graph) -> Outcome:
    """Three streams by ``--source``, one of which breaks off: that is told, with its address."""
    config, logs, run = graph.folder / "free_running.yaml", graph.folder / "log", graph.folder / "run"
    config.write_text("synchronizer: {image_period_s: 0.1, tolerance: 0.6, min_cameras: 2}\n")
    names = ("cam1", "cam2", "cam3")
    pictures = {
        image.camera: cv2.imencode(".jpg", image.pixels)[1].tobytes() for image in image_set_of(graph.recording, 0).images
    }
    with ExitStack() as ended:
        servers = {name: MjpegServer(lambda _, name=name: pictures[name], RATE_HZ) for name in names}
        for server in servers.values():
            ended.callback(server.close)
        addresses = [f"{name}=http://admin:{SECRET}@127.0.0.1:{servers[name].port}/a?pwd={SECRET}" for name in names]
        files = [("--rig", "rig.yaml"), ("--model", "model.yaml"), ("--initial-state", "state.yaml")]
        body = [part for option, name in files for part in (option, graph.recording / name)]
        pipeline = graph.launch("pipeline", *body, "--config", config, "--real-time", "--output", run, "--source", *addresses,
                                ROS_LOG_DIR=str(logs))  # fmt: skip
        graph.wait_for_states(5)
        commands = _commands_below(pipeline.pid)
        shown = sorted(command.split("\0")[command.split("\0").index("tracker_node.cli.main") + 1] for command in commands)
        servers["cam3"].pause.set()
        mark = len(graph.said)
        graph.until(lambda: any(name.endswith("cam3") and level > b"\0" for name, level, _ in graph.said[mark:]), "cam3 is told")
        pipeline.interrupt()
        status = pipeline.wait()
    kept = [path for folder in (logs, run) for path in folder.rglob("*") if path.is_file()]
    leaks = [path.name for path in kept if SECRET.encode() in path.read_bytes()]
    leaks += ["the terminal"] * (SECRET in pipeline.out + pipeline.err) + ["the command line"] * (SECRET in "".join(commands))
    leaks += ["/diagnostics"] * (SECRET in f"{graph.said} {graph.values}")
    masked = "***" in json.dumps(json.loads((run / "run.json").read_text()))
    seen = f"shown {'by ' + ', '.join(leaks) if leaks else 'nowhere'}: {len(kept)} files (logs, run.json, bag), command lines of "
    seen += f"{', '.join(shown)}, /diagnostics, terminal; exit status {status}"
    good = not leaks and masked and len(shown) == 3 and status == 0 and "Traceback" not in pipeline.err
    return Outcome(seen, "nothing", good)


def _commands_below(pid: int) -> list[str]:
    """Command lines of the children of a process, as everybody can read them."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(stat.read_text().rpartition(")")[2].split()[1]) == pid:
                found.append((stat.parent / "cmdline").read_text())
        except OSError:  # ended meanwhile
            continue
    return [command for command in found if "tracker_node.cli.main" in command]


DRILLS = (Drill("streams with a password", "shown in no message, log, file or command line", _password),)
