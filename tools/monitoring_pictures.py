"""The pictures of docs/nodes.md, made from a bag with markers and overlays (the demo's).

    .venv/bin/python tools/monitoring_pictures.py out/demo/bag

They show the topics and curves that the shipped layouts name; they are not screenshots of RViz, Foxglove or PlotJuggler.
"""

import argparse
import re
from pathlib import Path
from xml.etree import ElementTree

import cv2
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from trimesh.creation import box, icosphere

from tracker_node.geometry.so3 import matrix_from_xyzw
from tracker_node.loaders.bag.reader import BagReader

ROOT = Path(__file__).resolve().parents[1]
LAYOUT = ROOT / "config/plotjuggler/tracker.xml"
TABS = ("Fit", "Joint angles")


class Marker:
    """Kinds of visualization_msgs/Marker that bodies are made of; there may be no ROS here."""

    SPHERE, TRIANGLE_LIST = 2, 11


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bag", type=Path)
    parser.add_argument("--output", type=Path, default=ROOT / "docs/images")
    parser.add_argument("--layout", type=Path, default=LAYOUT, help="of PlotJuggler, whose curves are drawn")
    parser.add_argument("--instant", type=float, default=0.5, help="share of the recording that is shown (default: %(default)s)")
    args = parser.parse_args()
    with BagReader(args.bag) as reader:
        draw_body(reader, args.instant, args.output / "monitoring_markers.jpg")
        draw_overlays(reader, args.instant, args.output / "monitoring_overlays.jpg")
        draw_curves(reader, args.layout, args.output / "monitoring_curves.png")


def at(reader: BagReader, topic: str, share: float):
    """The message of a topic at a share of the recording."""
    messages = [message for _, message in reader.decoded(topic)]
    return messages[round(share * (len(messages) - 1))]


def draw_body(reader: BagReader, share: float, path: Path) -> None:
    """The shapes of ~/markers, with the trace of the root of ~/pose."""
    figure = plt.figure(figsize=(6, 6))
    axes = figure.add_subplot(projection="3d")
    points = []
    for marker in at(reader, "/tracker/markers", share).markers:
        p, q = marker.pose.position, marker.pose.orientation
        corners = corners_of(marker) @ matrix_from_xyzw(np.array([q.x, q.y, q.z, q.w])).T + (p.x, p.y, p.z)
        color = (marker.color.r, marker.color.g, marker.color.b)
        faces = corners.reshape(-1, 3, 3)
        triangles = Poly3DCollection(faces, facecolors=[color], edgecolors=[color], linewidths=0.2, shade=True)
        axes.add_collection3d(triangles)
        points.append(corners)
    everything = np.concatenate(points)
    trace = np.array([(m.pose.pose.position.x, m.pose.pose.position.y) for _, m in reader.decoded("/tracker/pose")])
    axes.plot(trace[:, 0], trace[:, 1], 0.0, color="tab:red", lw=2, label="the root's way, on the floor")
    low, high = everything.min(axis=0), everything.max(axis=0)
    middle, half = 0.5 * (low + high), 0.55 * (high - low).max()
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), zlim=(0, 2 * half))
    axes.set(xlabel="x, m", ylabel="y, m", zlabel="z, m")
    axes.set_aspect("equal")
    axes.locator_params(nbins=5)
    axes.view_init(elev=12, azim=35)
    axes.legend(loc="upper left", frameon=False)
    figure.savefig(path, dpi=110, bbox_inches="tight", pil_kwargs={"quality": 88})
    plt.close(figure)


def corners_of(marker) -> np.ndarray:
    """(3 n, 3) corners of the triangles of a marker, in its own frame."""
    if marker.type == Marker.TRIANGLE_LIST:
        return np.array([(c.x, c.y, c.z) for c in marker.points])
    unit = icosphere(subdivisions=2, radius=0.5) if marker.type == Marker.SPHERE else box()
    return unit.triangles.reshape(-1, 3) * (marker.scale.x, marker.scale.y, marker.scale.z)


def draw_overlays(reader: BagReader, share: float, path: Path) -> None:
    """Every camera's overlay, side by side."""
    topics = [topic for topic in sorted(reader.topics) if topic.endswith("/overlay/compressed")]
    pictures = [cv2.imdecode(np.frombuffer(at(reader, topic, share).data, np.uint8), cv2.IMREAD_COLOR) for topic in topics]
    height = 480
    pictures = [cv2.resize(p, (p.shape[1] * height // p.shape[0], height), interpolation=cv2.INTER_AREA) for p in pictures]
    gap = np.full((height, 6, 3), 255, np.uint8)
    row = [part for picture in pictures for part in (picture, gap)][:-1]
    cv2.imwrite(str(path), np.concatenate(row, axis=1), [cv2.IMWRITE_JPEG_QUALITY, 82])


def draw_curves(reader: BagReader, layout: Path, path: Path) -> None:
    """Two tabs of a layout of PlotJuggler, with the curves that it names."""
    root = ElementTree.parse(layout).getroot()
    tabs = {tab.get("tab_name"): tab for tab in root.iter("Tab")}
    columns = [list(tabs[name].iter("DockArea")) for name in TABS]
    figure, axes = plt.subplots(max(map(len, columns)), len(TABS), figsize=(14, 6.5), sharex=True, squeeze=False)
    for c, (name, column) in enumerate(zip(TABS, columns, strict=True)):
        axes[0, c].set_title(f"tab '{name}'")
        for r, area in enumerate(column):
            for curve in area.iter("curve"):
                seconds, values = curve_of(reader, curve.get("name"))
                label = curve.get("name").removeprefix("/tracker/")
                axes[r, c].plot(seconds, values, color=curve.get("color"), lw=1.3, label=label)
            axes[r, c].legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.03), frameon=False)
            axes[r, c].grid(alpha=0.3)
            title = area.get("name").partition(":")[0]
            axes[r, c].set_ylabel(title, fontsize=9)
            if "," not in title:  # without a unit: numbers of something
                axes[r, c].yaxis.set_major_locator(MaxNLocator(nbins=5, integer=True))
        for r in range(len(column), len(axes)):
            axes[r, c].set_visible(False)
        axes[len(column) - 1, c].set_xlabel("time, s")
        axes[len(column) - 1, c].tick_params(labelbottom=True)
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def curve_of(reader: BagReader, name: str) -> tuple[list[float], list[float]]:
    """Seconds and values of a curve, by PlotJuggler's name for it."""
    topic = next(topic for topic in sorted(reader.topics, key=len, reverse=True) if name.startswith(f"{topic}/"))
    field = name.removeprefix(f"{topic}/")
    seconds, values = [], []
    for _, message in reader.decoded(topic):
        stamp = message.header.stamp
        seconds.append(stamp.sec + 1e-9 * stamp.nanosec)
        values.append(value_of(message, field))
    return seconds, values


def value_of(message, field: str) -> float:
    if hasattr(message, "effort"):  # a JointState is shown by joint
        joint, _, quantity = field.partition("/")
        return float(getattr(message, quantity)[list(message.name).index(joint)])
    for part in field.split("/"):
        name, index = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", part).groups()
        message = getattr(message, name)
        message = message[int(index)] if index else message
    return float(message)


if __name__ == "__main__":
    main()
