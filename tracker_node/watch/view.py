"""Bodies and cameras in Rerun: what its viewer draws in 3D, over images and as curves.

One `RerunView` serves finished runs and a running graph: both hand it rows of a run. Times are `TIME`, in seconds since the first
image set, and `STAMP`, the stamps of the images.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ..camera.rig import Camera, CameraRig
from ..errors import extra_module
from ..geometry import so3
from ..loaders.layouts import joints_to_plot
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration
from ..model.kinematic_chain import N_ROOT_DOF
from ..render.opengl.tessellation import Patch, tessellate
from ..render.overlay import part_colors, part_outlines
from ..render.palette import CYCLE, STATES
from ..runs.data import RunData
from ..runs.messages import jpeg_of
from ..tracking.estimate import LimbStatus, Status

APPLICATION = "tracker_node"
TIME, STAMP = "time", "stamp"
SIGMAS = 2.0  # half axes of the ellipsoids, in standard deviations
HIDDEN = 1e-6  # scale of a body without a state: the viewer draws one of scale 0 as if it had none
LONGEST_PX = 640  # images are made smaller by a whole factor until no side is longer
_FAINT = {Status.LOST: 90, Status.DEGRADED: 170}  # opacity, of 255


def rerun_module() -> Any:
    """The package rerun.

    Raises
    ------
    MissingExtraError : it is not installed.
    """
    return extra_module("rerun", "rerun")


@dataclass(frozen=True, eq=False)
class _Body:
    """A body that is shown, with the colors of its parts (n_shapes, 3), RGB."""

    model: ArticulatedModel
    colors: np.ndarray
    color: tuple[int, int, int]


class RerunView:
    """What one viewer or file is given.

    Parameters
    ----------
    recording : stream of Rerun, with its sinks.
    models : bodies by their names; "" for one that is alone.
    rig : cameras, with the lenses of the images that are shown; None: no cameras and no images.
    begins_ns : stamp at which `TIME` is 0.
    with_images : the blueprint has views of images.
    """

    def __init__(
        self, recording: Any, models: Mapping[str, ArticulatedModel], rig: CameraRig | None, begins_ns: int, with_images: bool
    ):  # fmt: skip
        self._rr, self._recording, self._begins_ns = rerun_module(), recording, begins_ns
        self._cameras = {} if rig is None else {camera.name: _small(camera) for camera in rig}
        alone = len(models) == 1
        self._bodies = {
            name: _Body(model, *_colors(model, None if alone else i)) for i, (name, model) in enumerate(models.items())
        }
        self._recording.send_blueprint(self._blueprint(with_images))
        self._static("world", self._rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for name in self._bodies:
            self._log_body(name)
        depth = _drawn_depth(list(self._cameras.values()))
        for camera in self._cameras.values():
            self._log_camera(camera, depth)

    @staticmethod
    def place(body: str, link: str = "") -> str:
        """Entity of a body, or of one of its links.

        Parameters
        ----------
        body, link : names.

        Returns
        -------
        path : of the entity.
        """
        return "/".join(_escaped(part) for part in ("world", "bodies", body or "body", link) if part)

    @staticmethod
    def curves(body: str, what: str) -> str:
        """Entity of numbers or words over time.

        Parameters
        ----------
        body : its name.
        what : ``angles``, ``positions``, ``residual``, ``status`` or ``said``.

        Returns
        -------
        path : of the entity.
        """
        return f"{what}/{_escaped(body or 'body')}"

    @staticmethod
    def camera_place(camera: str, what: str = "") -> str:
        """Entity of a camera, its image, or the outlines of a body in it.

        Parameters
        ----------
        camera : its name.
        what : ``image``, or the name of a body.

        Returns
        -------
        path : of the entity.
        """
        return "/".join(_escaped(part) for part in ("world", "cameras", camera, what) if part)

    def show(self, body: str, run: RunData) -> None:
        """Poses, ellipsoids, curves and words of some image sets.

        Parameters
        ----------
        body : its name.
        run : the sets, in the order of their stamps; a set without a state hides the body.
        """
        rr, shown = self._rr, self._bodies[body]
        times = self._times(run.stamps_ns)
        known = run.has_state
        found = [run.configuration(shown.model, i) if known[i] else None for i in range(len(run))]
        for k, link in enumerate(shown.model.chain.links):
            Ts = np.array([np.eye(4) if each is None else each.Ts_world_link[k] for each in found])
            scale = np.repeat(np.where(known, 1.0, HIDDEN)[:, None], 3, axis=1)
            columns = rr.Transform3D.columns(translation=Ts[:, :3, 3], quaternion=_quaternions(Ts), scale=scale)
            self._recording.send_columns(self.place(body, link), times, columns)
        self._show_ellipsoids(body, run, found)
        self._show_curves(body, run)

    def show_image(self, camera: str, stamp_ns: int, bgr: np.ndarray) -> None:
        """An image of a camera, made small.

        Parameters
        ----------
        camera : its name.
        stamp_ns : of the image.
        bgr : (height, width, 3) uint8, or gray (height, width).
        """
        model = self._cameras[camera].model
        jpeg = jpeg_of(cv2.resize(bgr, (model.width, model.height), interpolation=cv2.INTER_AREA))
        self._log(self.camera_place(camera, "image"), stamp_ns, self._rr.EncodedImage(contents=jpeg, media_type="image/jpeg"))

    def show_outlines(self, camera: str, stamp_ns: int, body: str, run: RunData, row: int) -> None:
        """The outlines of a body's parts in an image; of a set without a state, none.

        Parameters
        ----------
        camera : its name.
        stamp_ns : of the image.
        body : its name.
        run, row : the set that the image is of.
        """
        shown, lines, colors = self._bodies[body], [], []
        if run.has_state[row]:
            configuration = run.configuration(shown.model, row)
            for part, line in part_outlines(configuration, self._cameras[camera]):
                lines.append(np.vstack([line, line[:1]]) + 0.5)  # Rerun's pixels have their corners at whole numbers
                colors.append(shown.colors[part])
        width = -1.0  # in points of the screen
        drawn = self._rr.LineStrips2D(lines, colors=np.array(colors, np.uint8).reshape(-1, 3), radii=width)
        self._log(self.camera_place(camera, body or "body"), stamp_ns, drawn)

    def _show_ellipsoids(self, body: str, run: RunData, found: Sequence[Configuration | None]) -> None:
        """Where each landmark is within `SIGMAS` standard deviations, as far as covariances are known."""
        centers: list[np.ndarray] = []
        axes: list[np.ndarray] = []
        turns: list[np.ndarray] = []
        counts = np.zeros(len(run), np.int64)
        for i, each in enumerate(found):
            covariance = None if run.details is None else run.details.covariances[i].astype(np.float64)
            if each is None or covariance is None or not covariance.any() or not np.isfinite(covariance).all():
                continue
            J = each.landmark_jacobian()
            squares, vectors = np.linalg.eigh(J @ covariance @ np.swapaxes(J, 1, 2))
            vectors[..., 0] *= np.linalg.det(vectors)[:, None]  # a rotation, no reflection
            centers.append(each.landmarks_world)
            axes.append(SIGMAS * np.sqrt(np.maximum(squares, 0.0)))
            turns.append(_quaternions(vectors))
            counts[i] = len(J)
        if not counts.any():
            return
        columns = self._rr.Ellipsoids3D.columns(
            centers=np.concatenate(centers), half_sizes=np.concatenate(axes), quaternions=np.concatenate(turns)
        )
        path = f"{self.place(body)}/uncertainty"
        self._recording.send_columns(path, self._times(run.stamps_ns), columns.partition(counts))

    def _show_curves(self, body: str, run: RunData) -> None:
        rr, times, send = self._rr, self._times(run.stamps_ns), self._recording.send_columns
        for what, columns in _dofs(self._bodies[body].model).items():
            values = run.values[:, columns] * (180.0 / np.pi if what == "angles" else 1.0)
            if columns:
                series = rr.Scalars.columns(scalars=values.ravel()).partition([len(columns)] * len(run))
                send(self.curves(body, what), times, series)
        send(self.curves(body, "residual"), times, rr.Scalars.columns(scalars=run.residual))
        statuses = [Status(int(number)) for number in run.status]
        send(self.curves(body, "status"), times, rr.StateChange.columns(state=[status.name for status in statuses]))
        changes = [i for i in range(len(run)) if i == 0 or statuses[i] != statuses[i - 1]]
        if changes:
            tints = np.array([_tint(statuses[i]) for i in changes], np.uint32)
            for link in self._bodies[body].model.chain.links:
                send(self.place(body, link), self._times(run.stamps_ns[changes]), rr.Mesh3D.columns(albedo_factor=tints))

    def say(self, body: str, stamp_ns: int, text: str) -> None:
        """The body's state in words.

        Parameters
        ----------
        body : its name.
        stamp_ns : of the image set.
        text : Markdown.
        """
        self._log(self.curves(body, "said"), stamp_ns, self._rr.TextDocument(text, media_type="text/markdown"))

    def _times(self, stamps_ns: np.ndarray) -> list[Any]:
        since = (stamps_ns - self._begins_ns).astype("timedelta64[ns]")
        stamps = stamps_ns.astype("datetime64[ns]")
        return [self._rr.TimeColumn(TIME, duration=since), self._rr.TimeColumn(STAMP, timestamp=stamps)]

    def _log(self, path: str, stamp_ns: int, what: Any) -> None:
        self._recording.set_time(TIME, duration=np.timedelta64(stamp_ns - self._begins_ns, "ns"))
        self._recording.set_time(STAMP, timestamp=np.datetime64(stamp_ns, "ns"))
        self._recording.log(path, what)

    def _static(self, path: str, what: Any) -> None:
        self._recording.log(path, what, static=True)

    def _log_body(self, name: str) -> None:
        """What does not change: the surface of each link, names and colors of the curves."""
        rr, body = self._rr, self._bodies[name]
        model = body.model
        for link in model.chain.links:
            patches = []
            for shape, color in zip(model.shapes, body.colors, strict=True):
                if shape.link == link:
                    own = shape.color_rgb if shape.has_color and len(self._bodies) == 1 else tuple(color.tolist())
                    patches += [_moved(patch, shape.T_link_shape) for patch in tessellate(shape.primitive, own)]
            if patches:
                self._static(self.place(name, link), rr.Mesh3D(**_merged(patches)))
        ellipsoids = rr.Ellipsoids3D.from_fields(colors=[(*body.color, 90)], fill_mode="solid")
        self._static(f"{self.place(name)}/uncertainty", ellipsoids)
        for what, columns in _dofs(model).items():
            if columns:
                names = [model.chain.dof_names[i] for i in columns]
                large = {joint for joint, _ in joints_to_plot(model)} if what == "angles" else set(names)
                lines = rr.SeriesLines(names=names, visible_series=[each in large for each in names])
                self._static(self.curves(name, what), lines)
        self._static(self.curves(name, "residual"), rr.SeriesLines(names=f"residual {name}".strip(), colors=body.color))
        states = [status.name for status in Status]
        colors = np.array([int(STATES[state.lower()][1:] + "ff", 16) for state in states], np.uint32)
        self._static(self.curves(name, "status"), rr.StateConfiguration(values=states, labels=states, colors=colors))

    def _log_camera(self, camera: Camera, depth: float) -> None:
        rr, model, path = self._rr, camera.model, self.camera_place(camera.name)
        K = model.K.copy()
        K[:2, 2] += 0.5  # Rerun's pixels have their corners at whole numbers
        T = camera.T_world_cam
        self._static(path, rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3]))
        size = (model.width, model.height)
        lens = rr.Pinhole(
            image_from_camera=K, resolution=size, camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=depth
        )  # fmt: skip
        self._static(path, lens)

    def _blueprint(self, with_images: bool) -> Any:
        """3D, images, curves and words."""
        import rerun.blueprint as rrb

        angles = [
            rrb.TimeSeriesView(origin=self.curves(name, "angles"), name=" ".join(filter(None, ("joint angles, deg", name))))
            for name in self._bodies
        ]
        said = [rrb.TextDocumentView(origin=self.curves(name, "said"), name=name or "state") for name in self._bodies]
        curves = rrb.Vertical(
            rrb.Tabs(*angles) if len(angles) > 1 else angles[0],
            rrb.TimeSeriesView(origin="residual", name="residual"),
            rrb.StateTimelineView(origin="status", name="status"),
            rrb.Horizontal(*said),
            row_shares=[3, 2, 1, 1],
        )
        parts: list[Any] = [rrb.Spatial3DView(origin="world", name="3D"), curves]
        if with_images and self._cameras:
            views = [rrb.Spatial2DView(origin=self.camera_place(name), name=name) for name in self._cameras]
            parts.insert(1, rrb.Grid(*views, grid_columns=1 if len(views) < 4 else 2))
        return rrb.Blueprint(
            rrb.Horizontal(*parts, column_shares=[3] * (len(parts) - 1) + [2]), rrb.TimePanel(timeline=TIME, state="collapsed"),
            rrb.SelectionPanel(state="hidden"), rrb.BlueprintPanel(state="hidden"), auto_views=False,
        )  # fmt: skip


def words(run: RunData, row: int, reason: str = "") -> str:
    """What a state says of itself, as Markdown.

    Parameters
    ----------
    run, row : the set.
    reason : of the status, where it is known.

    Returns
    -------
    text : status, residual, and limbs that are not tracked.
    """
    lines = [f"**{Status(int(run.status[row])).name}**", *([reason] if reason else [])]
    if np.isfinite(run.residual[row]):
        lines.append(f"residual {run.residual[row]:.2f} {run.residual_unit}")
    if run.details is not None and run.details.limbs:
        limbs = zip(run.details.limbs, run.details.limb_status[row], strict=True)
        lines += [f"{name}: {LimbStatus(int(s)).name.lower()}" for name, s in limbs if s != int(LimbStatus.TRACKING)]
    return "\n\n".join(lines)


def _escaped(part: str) -> str:
    return rerun_module().escape_entity_path_part(part)


def _small(camera: Camera) -> Camera:
    """The camera with images whose sides are no longer than `LONGEST_PX`."""
    model = camera.model
    factor = -(-max(model.width, model.height) // LONGEST_PX)
    return replace(camera, model=model.resized(model.width // factor, model.height // factor)) if factor > 1 else camera


def _colors(model: ArticulatedModel, number: int | None) -> tuple[np.ndarray, tuple[int, int, int]]:
    """Of the parts and of the whole: one body has its sides in other colors, each of several has its own."""
    text = CYCLE[(number or 0) % len(CYCLE)]
    own = int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)
    if number is not None:
        return np.tile(np.array(own, np.uint8), (len(model.shapes), 1)), own
    return np.ascontiguousarray(part_colors(model)[1:, ::-1]), own


def _dofs(model: ArticulatedModel) -> dict[str, list[int]]:
    """Joints that turn, and what is a length, the root's place among it: positions in the state."""
    units = model.chain.dof_units
    turning = [i for i, unit in enumerate(units) if unit == "rad" and i >= N_ROOT_DOF]
    return {"angles": turning, "positions": [i for i, unit in enumerate(units) if unit == "m"]}


def _tint(status: Status) -> int:
    """RGBA that the surface's own colors are multiplied by; a lost body is faint and red."""
    red, green, blue = (int(STATES["lost"][i : i + 2], 16) for i in (1, 3, 5)) if status == Status.LOST else (255, 255, 255)
    return (red << 24) | (green << 16) | (blue << 8) | _FAINT.get(status, 255)


def _moved(patch: Patch, T: np.ndarray) -> Patch:
    return replace(patch, vertices=patch.vertices @ T[:3, :3].T + T[:3, 3], normals=patch.normals @ T[:3, :3].T)


def _merged(patches: Sequence[Patch]) -> dict[str, np.ndarray]:
    """Surfaces of one link as one."""
    firsts = np.cumsum([0, *(len(patch.vertices) for patch in patches)])
    return {
        "vertex_positions": np.concatenate([patch.vertices for patch in patches]),
        "vertex_normals": np.concatenate([patch.normals for patch in patches]),
        "triangle_indices": np.concatenate([patch.faces + first for patch, first in zip(patches, firsts, strict=False)]),
        "vertex_colors": (255.0 * np.concatenate([patch.colors for patch in patches])).astype(np.uint8),
    }


def _quaternions(Ts: np.ndarray) -> np.ndarray:
    """(n, 4) x, y, z, w of rotations (n, 3, 3) or the like within transforms (n, 4, 4)."""
    return np.array([so3.xyzw_from_matrix(T[:3, :3]) for T in Ts]).reshape(-1, 4)


def _drawn_depth(cameras: Sequence[Camera]) -> float:
    """How far before the cameras their images are drawn, meters: a fifth of the way to the middle between them."""
    if len(cameras) < 2:
        return 0.5
    centers = np.array([camera.center for camera in cameras])
    return float(np.clip(0.2 * np.linalg.norm(centers - centers.mean(axis=0), axis=1).mean(), 0.05, 1.0))
