"""Camera rigs as YAML (``rig.yaml``; the format is described in docs/formats.md)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ...camera.distortion import COEFFICIENT_COUNTS
from ...camera.light import Light
from ...camera.model import CameraModel, plausible
from ...camera.rig import Camera, CameraRig, CaptureSettings
from ...errors import CalibrationError, FileFormatError, SourceError
from ...geometry import se3
from ..file_model import (
    RIG,
    FileModel,
    Number,
    PositiveNumber,
    are_numbers,
    checked,
    floats,
    is_number,
    numbers,
    problem,
    validate,
)
from ..source_address import TOPIC_NAME, parse_source, relocated
from ..yaml_file import read_mapping, write_mapping
from .capture_yaml import CaptureEntry, capture_entry
from .lens import is_side

NS_PER_S = 1_000_000_000
MAX_SCALE = 1e4  # between the pixels of a file and those of the calibration
MAX_DRIFT_PPM = 1e5  # a tenth; quartz clocks have 100 millionths


def _is_size(value: Any) -> bool:
    return are_numbers(value, 2) and all(map(is_side, value))


def _three(value: Any) -> Any:
    return [value] * 3 if is_number(value) else value


def _is_gain(value: Any) -> bool:
    return are_numbers(_three(value), 3) and all(0 < v < 1e6 for v in _three(value))


def check_source(value: Any, field: str = "") -> str:
    """Validator of an image source.

    Parameters
    ----------
    value : text of the grammar of `loaders.source_address`.
    field : name below the place where the validator stands, for the message.

    Returns
    -------
    The value.

    Raises
    ------
    PydanticCustomError : no text, or a source of an unknown kind.
    """
    try:
        if not isinstance(value, str):
            raise SourceError(str(value), "is no text")
        parse_source(value)
    except SourceError as error:
        expected = "a path, or a source of a known kind (file:, bag:, v4l2:, topic:, rtsp://, http://, udp://)"
        raise problem(expected, error.source, field) from None
    return value


def _is_topic(value: Any) -> bool:
    return isinstance(value, str) and TOPIC_NAME.fullmatch(value) is not None


ImageSize = Annotated[tuple[int, int], checked("[width, height] in whole pixels", _is_size, lambda v: tuple(map(int, v)))]
Gain = Annotated[tuple[float, float, float], checked("one positive number or [r, g, b]", _is_gain, lambda v: floats(_three(v)))]
Source = Annotated[str, BeforeValidator(lambda value: check_source(value))]
Topic = Annotated[str, checked("the name of an image topic, such as /front/image_raw", _is_topic)]


class CameraEntry(FileModel):
    """One camera as the file states it: calibration in calibration pixels, extrinsics, source."""

    image_size: ImageSize
    K: numbers(3, 3)  # type: ignore[valid-type]
    distortion_model: Literal["none", "plumb_bob", "rational_polynomial", "equidistant"] = "none"
    distortion: numbers(None) = ()  # type: ignore[valid-type]
    T_world_cam: numbers(4, 4)  # type: ignore[valid-type]
    source: Source | None = None
    topic: Topic | None = None
    capture: CaptureEntry | None = None
    time_offset_s: Number = 0.0
    time_drift_ppm: Number = 0.0
    stamps: Literal["rate", "container", "device", "capture"] | None = None
    stamp_file: str | None = None
    background: str | None = None
    interlaced: Literal["top_first", "bottom_first"] | None = None
    pixel_map: numbers(2, 3) | None = None  # type: ignore[valid-type]
    file_image_size: ImageSize | None = None
    gain: Gain = (1.0, 1.0, 1.0)
    gamma: PositiveNumber = 1.0

    @model_validator(mode="after")
    def _consistent(self) -> CameraEntry:
        counts = COEFFICIENT_COUNTS[self.distortion_model]
        if len(self.distortion) not in counts:
            several = " or ".join(str(count) for count in counts)
            raise problem(f"{several} coefficients for {self.distortion_model}", self.distortion, "distortion")
        if not se3.is_rigid(np.array(self.T_world_cam), tolerance=1e-4):
            raise problem("a rigid 4 x 4 transform (rotation, meters, last row 0 0 0 1)", self.T_world_cam, "T_world_cam")
        lower = (self.K[1][0], self.K[2][0], self.K[2][1])
        if self.K[0][0] != 0.0 and (any(lower) or self.K[2][2] != 1.0 or self.K[0][0] < 0.0 or self.K[1][1] <= 0.0):
            raise problem("[[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with positive focal lengths", self.K, "K")
        self._check_lens()
        if self.stamps is not None and self.stamp_file is not None:
            raise problem("either stamps or a stamp_file", "both", "stamps")
        if abs(self.time_drift_ppm) > MAX_DRIFT_PPM:
            raise problem(f"at most {MAX_DRIFT_PPM:g} millionths", self.time_drift_ppm, "time_drift_ppm")
        self._check_pixel_map()
        return self

    def _check_lens(self) -> None:
        if self.K[0][0] == 0.0:  # uncalibrated
            return
        try:
            plausible(CameraModel(*self.image_size, np.array(self.K), self.distortion_model, np.array(self.distortion)))
        except ValueError as error:
            raise problem("the numbers of a lens", str(error), "K") from None

    def _check_pixel_map(self) -> None:
        if self.pixel_map is None:
            if self.file_image_size not in (None, self.image_size):
                raise problem("a pixel_map beside file_image_size", "nothing", "pixel_map")
            return
        (sx, _, _), (zero, sy, _) = self.pixel_map
        if zero != 0.0 or not all(1.0 / MAX_SCALE < scale < MAX_SCALE for scale in (sx, sy)):
            expected = f"[[sx, skew, tx], [0, sy, ty]] with sx, sy > 0 (and no more than {MAX_SCALE:g} times larger or smaller)"
            raise problem(expected, self.pixel_map, "pixel_map")
        if self.file_image_size is None:
            raise problem("the size of the file's images beside pixel_map", "nothing", "file_image_size")

    def model(self, name: str) -> CameraModel:
        """Lens for the pixels of the file: the map file -> calibration is undone in K.

        Raises
        ------
        CalibrationError : K[0] = 0, the mark of an uncalibrated camera.
        """
        if self.K[0][0] == 0.0:
            raise CalibrationError(name, "uncalibrated (K[0] = 0): calibrate it, or take it out of the rig")
        model = CameraModel(*self.image_size, np.array(self.K), self.distortion_model, np.array(self.distortion))
        if self.pixel_map is None or self.file_image_size is None:
            return model
        cal_from_file = np.vstack([self.pixel_map, [0.0, 0.0, 1.0]])
        file_from_cal = np.linalg.inv(cal_from_file)[:2]
        file_from_cal[1, 0] = 0.0
        return model.mapped(file_from_cal, *self.file_image_size)


class LightEntry(FileModel):
    """A light of the scene, in world axes; what a kind has no use for is left out."""

    kind: Literal["ambient", "directional", "point", "spot"]
    position: numbers(3) | None = None  # type: ignore[valid-type]
    direction: numbers(3) | None = None  # type: ignore[valid-type]
    cone_deg: Number | None = None
    intensity: Gain = (1.0, 1.0, 1.0)

    @model_validator(mode="after")
    def _complete(self) -> LightEntry:
        needed = {"point": ("position",), "spot": ("position", "direction", "cone_deg"), "directional": ("direction",)}
        for name in needed.get(self.kind, ()):
            if getattr(self, name) is None:
                raise problem(f"a value for a {self.kind} light", "nothing", name)
        if self.direction is not None and not np.linalg.norm(self.direction) > 0.0:
            raise problem("a direction of non-zero length", self.direction, "direction")
        if self.cone_deg is not None and not 0.0 < self.cone_deg < 180.0:
            raise problem("a half angle in (0, 180) degrees", self.cone_deg, "cone_deg")
        return self

    def light(self) -> Light:
        half_angle = None if self.cone_deg is None else float(np.deg2rad(self.cone_deg))
        return Light(self.kind, self.intensity, self.position, self.direction, half_angle)


class RigFile(FileModel):
    """A whole rig file, kept as written so that it can be changed and dumped again."""

    KIND: ClassVar[str] = RIG

    world_frame: str = "world"
    cameras: dict[str, CameraEntry] = Field(min_length=1)
    lights: tuple[LightEntry, ...] = ()

    @model_validator(mode="after")
    def _usable_names(self) -> RigFile:
        for name in self.cameras:
            if not name.isidentifier() or not name.isascii():
                raise problem("a camera name of letters, digits and _ (it becomes a topic)", name, f"cameras.{name}")
        return self

    def with_cameras(self, changes: Mapping[str, Mapping[str, Any]]) -> RigFile:
        """The same rig with other values of some cameras (name -> field -> value)."""
        changed = {name: self.cameras[name].model_copy(update=values) for name, values in changes.items()}
        return self.model_copy(update={"cameras": {**self.cameras, **changed}})

    def with_extrinsics(self, Ts_world_cam: Mapping[str, np.ndarray]) -> RigFile:
        """The same rig with some cameras placed anew (name -> (4, 4))."""
        return self.with_cameras(
            {name: {"T_world_cam": tuple(tuple(float(v) for v in row) for row in T)} for name, T in Ts_world_cam.items()}
        )

    def in_calibration_pixels(self) -> RigFile:
        """The same rig for the pixels of the calibration: without any pixel map."""
        return self.with_cameras({name: {"pixel_map": None, "file_image_size": None} for name in self.cameras})


def read_rig_file(path: str | Path) -> RigFile:
    """The validated content of a rig file.

    Raises
    ------
    FileFormatError : naming file, dotted field, what was expected and what stands there.
    """
    values = read_mapping(path)
    _refuse_renamed(values, path)
    return validate(RigFile, values, path)


def _refuse_renamed(values: Mapping[str, Any], path: str | Path) -> None:
    """Refuse the name that images of the background had in version 0.1."""
    cameras = values.get("cameras")
    for name, entry in cameras.items() if isinstance(cameras, dict) else ():
        if isinstance(entry, dict) and "plate" in entry:
            expected = "its present name, background (`tracker_node migrate` rewrites files)"
            raise FileFormatError(path, f"cameras.{name}.plate", expected, entry["plate"])


def build_rig(rig_file: RigFile, base_dir: str | Path) -> CameraRig:
    """Cameras of a rig file.

    Parameters
    ----------
    rig_file, base_dir : content; folder that relative sources and backgrounds are taken from.

    Returns
    -------
    Rig.

    Raises
    ------
    CalibrationError : naming a camera that is not calibrated.
    """
    cameras = []
    for name, entry in rig_file.cameras.items():
        cameras.append(
            Camera(
                name=name,
                model=entry.model(name),
                T_world_cam=se3.nearest_rigid(np.array(entry.T_world_cam)),
                source=_resolved(entry.source, base_dir),
                topic=entry.topic,
                capture=entry.capture.settings() if entry.capture else CaptureSettings(),
                time_offset_ns=round(entry.time_offset_s * NS_PER_S),
                time_drift_ppm=entry.time_drift_ppm,
                stamps=entry.stamps,
                stamp_file=_resolved(entry.stamp_file, base_dir),
                background=_resolved(entry.background, base_dir),
                interlaced=entry.interlaced,
                gain=entry.gain,
                gamma=entry.gamma,
            )
        )
    return CameraRig(tuple(cameras), rig_file.world_frame, tuple(light.light() for light in rig_file.lights))


def load_rig(path: str | Path) -> CameraRig:
    """The rig of a file, ready for use (see `read_rig_file` and `build_rig` for what is refused)."""
    try:
        return build_rig(read_rig_file(path), Path(path).parent)
    except CalibrationError as error:
        where = f"{path}: field 'cameras.{error.camera}.K'"
        raise CalibrationError(error.camera, f"{error.problem} ({where})") from None


def write_rig_file(rig_file: RigFile, path: str | Path, base_dir: str | Path | None = None) -> None:
    """Write a rig file.

    Parameters
    ----------
    rig_file, path : content; YAML file.
    base_dir : folder that relative sources and backgrounds are relative to: they are rewritten for the folder of ``path``. None:
        they are written as they are.
    """
    values = rig_file.model_dump(mode="python", exclude_none=True, exclude_defaults=True)
    values = {key: values[key] for key in ("world_frame", "cameras", "lights") if key in values}
    for entry in values["cameras"].values():
        for key in ("source", "background", "stamp_file"):
            if base_dir is not None and key in entry:
                entry[key] = relocated(entry[key], base_dir, Path(path).parent)
    write_mapping(values, path, "Camera rig; the format is described in docs/formats.md.")


def rig_file_of(rig: CameraRig) -> RigFile:
    """A rig file that says what ``rig`` is, for rigs that come from elsewhere."""
    cameras = {}
    for camera in rig:
        cameras[camera.name] = CameraEntry(
            image_size=(camera.model.width, camera.model.height),
            K=camera.model.K,
            distortion_model=camera.model.distortion_model,  # type: ignore[arg-type]
            distortion=camera.model.distortion,
            T_world_cam=camera.T_world_cam,
            source=camera.source,
            topic=camera.topic,
            capture=capture_entry(camera.capture),
            time_offset_s=camera.time_offset_ns / NS_PER_S,
            time_drift_ppm=camera.time_drift_ppm,
            stamps=camera.stamps,  # type: ignore[arg-type]
            stamp_file=camera.stamp_file,
            background=camera.background,
            interlaced=camera.interlaced,  # type: ignore[arg-type]
            gain=camera.gain,
            gamma=camera.gamma,
        )
    lights = tuple(
        LightEntry(
            kind=light.kind,  # type: ignore[arg-type]
            position=light.position,
            direction=light.direction,
            cone_deg=None if light.half_angle is None else float(np.rad2deg(light.half_angle)),
            intensity=light.intensity,
        )
        for light in rig.lights
    )
    return RigFile(world_frame=rig.world_frame, cameras=cameras, lights=lights)


def _resolved(source: str | None, base_dir: str | Path) -> str | None:
    return None if source is None else relocated(source, base_dir)
