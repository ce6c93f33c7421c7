"""``tracker_node studio``."""

from __future__ import annotations

import argparse
import html
import signal
import sys
import tempfile
import webbrowser
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from ._last_resort import unexpected

SUMMARY = "serve a local web page: from videos to a report, a pose by hand, digitized points, a run played back, a running graph"
EXAMPLE = (
    "tracker_node studio --rig rig.yaml --model person.yaml --initial-state start.yaml --run out/run1\n"
    "  tracker_node studio --new walk"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", type=Path, metavar="FILE", help="rig.yaml: cameras, and the videos or folders they read")
    parser.add_argument("--model", type=Path, metavar="FILE", help="model.yaml or URDF: the body")
    parser.add_argument("--config", type=Path, metavar="FILE", help="tracker parameters, for scores and fits (default: built in)")
    parser.add_argument("--initial-state", type=Path, metavar="FILE", help="state.yaml: the pose at first (default: neutral)")
    parser.add_argument("--run", type=Path, metavar="RUN", help="folder written by track, or a bag, to play back")
    parser.add_argument(
        "--folder", type=Path, default=Path("out/studio"), help="where poses are saved and loaded (default: %(default)s)"
    )
    parser.add_argument(
        "--clicks", type=Path, default=Path("out/digitized"), metavar="FOLDER",
        help="where digitized points are saved (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--control-points", type=Path, metavar="CSV", help="points of known place, for cameras by DLT")
    parser.add_argument(
        "--new", type=Path, metavar="FOLDER", help="folder of a recording: seven steps from its videos to a report, and all other"
        " files from there",
    )  # fmt: skip
    parser.add_argument("--port", type=int, default=0, help="port of 127.0.0.1 to serve (default: a free one)")
    parser.add_argument("--no-browser", action="store_true", help="only print the address, do not open a browser")


def run(args: argparse.Namespace) -> int:
    from ..errors import FileFormatError, extra_module

    uvicorn, *_ = (extra_module(package, "studio") for package in ("uvicorn", "starlette", "websockets"))
    from ..studio.server import all_pages, listening_socket, make_app
    from ..studio.session import StudioFiles, open_session

    if not 0 <= args.port < 65536:
        raise FileFormatError("command line", "--port", "a number from 0 to 65535", args.port)
    others = ("rig", "model", "config", "initial_state", "run", "control_points")
    if args.new is not None and (given := [name for name in others if getattr(args, name) is not None]):
        option = f"--{given[0].replace('_', '-')}"
        raise FileFormatError("command line", option, "none beside --new, whose folder has it", given[0])
    if args.new is not None and not args.new.is_dir():
        raise FileFormatError("command line", "--new", "a folder with videos", str(args.new))
    named = {name: getattr(args, name) for name in StudioFiles.__dataclass_fields__}
    session = open_session(StudioFiles(**named))
    for problem in session.images.problems if session.images is not None else ():
        print(f"studio: {problem}", file=sys.stderr)
    listener, access = listening_socket(args.port)
    app = make_app(session, access, all_pages(), lambda error: unexpected("studio", sys.argv[2:], error))
    server = uvicorn.Server(
        uvicorn.Config(app, log_level="warning", access_log=False, server_header=False, timeout_graceful_shutdown=2)
    )
    for number in (signal.SIGINT, signal.SIGTERM):  # uvicorn's own handlers come later than somebody may
        signal.signal(number, lambda *_: setattr(server, "should_exit", True))
    with session.closing, closing(listener):
        url = access.start_url if args.new is None else access.start_url.replace("/?", "/wizard.html?")
        print(f"studio: {url}\nstudio: Ctrl-C ends it", flush=True)
        if not args.no_browser:
            session.closing.enter_context(_opened_in_browser(url))
        server.run(sockets=[listener])
    return 0


@contextmanager
def _opened_in_browser(url: str) -> Iterator[None]:
    """By a page that only this user can read: everybody on the machine sees a browser's arguments, and so would see the token."""
    with tempfile.TemporaryDirectory(prefix="tracker_node_studio_") as folder:
        page = Path(folder) / "studio.html"
        page.write_text(f'<!doctype html><meta http-equiv="refresh" content="0;url={html.escape(url)}"><title>studio</title>')
        webbrowser.open(page.as_uri())
        yield
