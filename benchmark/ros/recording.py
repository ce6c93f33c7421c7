#!/usr/bin/env python3
"""Whether a bag takes everything: six 640x480 color cameras at 30 Hz (166 MB/s) and a tracker's results, to the recorder's disk.

Every image that the ingest has published, and every result, is looked for in the finished bag. The processor time is that of
the recorder's process, in percent of one core, from two seconds after its first message on. Then recorders of the same streams
are killed with SIGKILL, and the last message of each topic that can be read is compared with the time of the kill; the
figure is the worst of all topics and kills.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
import tempfile
from pathlib import Path

from tracker_node.errors import TrackerError
from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.ros.recorder._runs import kill, record, streams
from benchmark.ros.transport import N_CAMERAS

SECONDS = {"quick": 8.0, "full": 60.0}
KILLED_AFTER_S = {"quick": (1.0, 1.3), "full": (1.0, 1.2, 1.4, 1.6, 1.8)}
TARGETS = {"recorder.lost": 0.0, "recorder.cpu_percent": 25.0, "recorder.kill_loss_s": 2.0}


def measure(folder: Path, effort: str) -> dict[str, float]:
    """Record for some time, then kill; the metrics."""
    (folder / "whole").mkdir()
    recording = record(folder / "whole", SECONDS[effort])
    print("\n".join(recording.lines), file=sys.stderr)
    shutil.rmtree(folder / "whole")
    (folder / "killed").mkdir()
    with streams(folder / "killed"):
        kills = []
        for i, seconds in enumerate(KILLED_AFTER_S[effort]):
            kills.append(kill(folder / "killed" / f"bag{i}", seconds))
            print(f"killed after {seconds:g} s: {kills[-1].problem}", file=sys.stderr)
            shutil.rmtree(folder / "killed" / f"bag{i}")
    return {
        "recorder.published": sum(recording.published.values()),
        "recorder.recorded": sum(recording.recorded.values()),
        "recorder.lost": recording.lost,
        "recorder.cpu_percent": recording.cpu_percent,
        "recorder.mb_per_s": recording.mb_per_s,
        "recorder.seconds": recording.seconds,
        "recorder.cameras": N_CAMERAS,
        "recorder.kills": len(kills),
        "recorder.kill_loss_s": max(max(each.loss_s.values()) for each in kills),
        "recorder.kill_gaps": sum(len(each.gaps) for each in kills),
    }


def main() -> int:
    parser = parser_of(__doc__, "", f"{SECONDS['quick']:g} s instead of {SECONDS['full']:g} s")
    parser.add_argument("--folder", type=Path, help="where to write (up to 12 GB; default: the folder for temporary files)")
    args = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the folder is removed
    with tempfile.TemporaryDirectory(prefix="recording_", dir=args.folder) as folder:
        try:
            metrics = measure(Path(folder), "quick" if args.quick else "full")
        except TrackerError as error:
            print(f"recording: error: {error}", file=sys.stderr)
            return 2
    report_metrics(metrics, args.json)
    return 0 if all(metrics[key] <= most for key, most in TARGETS.items()) else 1


if __name__ == "__main__":
    sys.exit(main())
