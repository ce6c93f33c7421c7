"""Which cameras are published, from which sources: those of a rig, with what the command line changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig, CaptureSettings
from ...errors import CalibrationError, SourceError, TrackerError, UnknownNameError
from ...loaders.decoding import check_fields
from ...loaders.images.file_sources import topic_of_camera
from ...loaders.images.live_capture import check_live_settings
from ...loaders.images.source import (
    ImageSource,
    PreloadedSource,
    SourceOptions,
    check_recorded,
    open_camera_source,
    open_source,
    size_contradiction,
)
from ...loaders.rig.camera_info import load_lens
from ...loaders.rig.capture_yaml import changed_settings
from ...loaders.source_address import BAG, SourceAddress, parse_source

_LONGEST_BETWEEN_STARTS_S = 3600


@dataclass(frozen=True)
class IngestCamera:
    """One camera to publish.

    Parameters
    ----------
    name : for its topics.
    source : where its images come from.
    capture : how they are taken.
    lens : for the source's own pixels; None for a camera that is not calibrated yet.
    of_rig : what the rig knows of it; None without a rig.
    """

    name: str
    source: str
    capture: CaptureSettings
    lens: CameraModel | None = None
    of_rig: Camera | None = None

    @property
    def frame_id(self) -> str:
        return f"{self.name}_optical_frame" if self.of_rig is None else self.of_rig.frame_id

    @property
    def address(self) -> SourceAddress:
        return parse_source(self.source)

    @property
    def interlaced(self) -> str | None:
        return None if self.of_rig is None else self.of_rig.interlaced


@dataclass(frozen=True)
class OpenedCameras:
    """The cameras that can be used, and why others cannot.

    Parameters
    ----------
    cameras : name -> camera, in the order of the rig.
    recorded : sources of those whose images are recorded; the others are live.
    problems : name -> what is wrong.
    """

    cameras: Mapping[str, IngestCamera]
    recorded: Mapping[str, ImageSource]
    problems: Mapping[str, str]

    @property
    def live(self) -> tuple[str, ...]:
        return tuple(name for name in self.cameras if name not in self.recorded)

    def n_sets(self, loop: bool = False) -> int | None:
        """Image sets to expect; None where the images have no end."""
        return None if loop or self.live else min(source.n_images for source in self.recorded.values())

    def check_trackable(self, real_time: bool) -> None:
        """Check that a tracker beside the ingest can follow these cameras.

        Raises
        ------
        TrackerError : live cameras that are to wait for the tracker, or images that have no pixels; naming them.
        """
        if self.live and not real_time:
            raise TrackerError(f"{', '.join(self.live)}: live cameras do not wait for the tracker: give --real-time")
        undecoded = [name for name, camera in self.cameras.items() if camera.capture.publish == "jpeg"]
        if undecoded:
            raise TrackerError(f"{', '.join(undecoded)}: publish: jpeg gives no pixels to track; use color or mono")


def chosen_cameras(
    rig: CameraRig | None,
    names: Sequence[str] = (),
    sources: Mapping[str, str] | None = None,
    changes: Sequence[tuple[str | None, str, str]] = (),
) -> list[IngestCamera]:
    """Cameras with their sources, lenses not yet looked up.

    Parameters
    ----------
    rig : its cameras that have a source; None for cameras that nothing else is known of.
    names : only these of them.
    sources : camera -> source, instead of the rig's, or besides.
    changes : (camera, or None for all of them; field; value) of capture settings.

    Returns
    -------
    cameras : with their sources, in the order of ``names`` or of the rig.

    Raises
    ------
    TrackerError : a name or a field that is not known, or no camera at all.
    """
    sources = dict(sources or {})
    of_rig = {camera.name: camera for camera in rig} if rig is not None else {}
    known = [*of_rig, *sources] if rig is None else list(of_rig)
    for name in (*names, *sources, *(camera for camera, _, _ in changes if camera is not None)):
        if name not in known:
            raise UnknownNameError("camera", name, known)
    result = []
    for name in names or known:
        camera = of_rig.get(name)
        source = sources.get(name) or (camera.source if camera else None)
        if source is None and not names:
            continue  # left to others
        parse_source(source or "")
        own = [(field, value) for target, field, value in changes if target in (None, name)]
        capture = changed_settings(camera.capture if camera else CaptureSettings(), own)
        result.append(IngestCamera(name, source or "", capture, camera.model if camera else None, camera))
    if not result:
        raise SourceError("rig", "none of its cameras has a source")
    return result


def open_cameras(chosen: Sequence[IngestCamera], options: SourceOptions, preload: bool = False) -> OpenedCameras:
    """Look lenses up, open recordings, and check settings of live sources, which are not connected to yet.

    Parameters
    ----------
    chosen : cameras with their sources.
    options : which images of recordings.
    preload : decode recordings into memory first.

    Returns
    -------
    opened : the cameras that can be used; problems of the others by name.

    Raises
    ------
    TrackerError : when not a single one can be used, recordings have no clock in common, or would be resampled to another aspect.
    """
    cameras: dict[str, IngestCamera] = {}
    recorded: dict[str, ImageSource] = {}
    problems: dict[str, str] = {}
    sizes: dict[str, tuple[int, int]] = {}
    first: TrackerError | None = None
    for camera in chosen:
        try:
            camera = _with_kept_lens(camera)
            if camera.address.is_live:
                stamps = camera.of_rig.stamps if camera.of_rig else None
                check_live_settings(camera.address, camera.capture, stamps)
                if camera.interlaced:
                    check_fields(camera.capture, camera.address.shown)
            else:
                source = _open_recorded(camera, options)
                sizes[camera.name] = source.native_width, source.native_height
                recorded[camera.name] = PreloadedSource(source) if preload else source
            cameras[camera.name] = camera
        except TrackerError as error:
            problems[camera.name] = str(error)
            first = first or error
    if not cameras and first is not None:
        raise first
    for name, size in sizes.items():
        options.check_aspect(*size, name)
    _check_common_clock(recorded)
    return OpenedCameras(cameras, recorded, problems)


def _check_common_clock(recorded: Mapping[str, ImageSource]) -> None:
    """Recordings go out in the order of their stamps: one whose stamps are of another clock would never be its turn."""
    began = {name: source.stamp_ns(source.options.start) for name, source in recorded.items()}
    first, last = min(began, key=began.__getitem__, default=""), max(began, key=began.__getitem__, default="")
    if began and began[last] - began[first] > _LONGEST_BETWEEN_STARTS_S * 10**9:
        seconds = (began[last] - began[first]) / 1e9
        raise SourceError(
            recorded[last].path,
            f"camera '{last}' begins {seconds:.0f} s after camera '{first}': their stamps are of different clocks"
            " (give stamps, stamp_file or time_offset_s in the rig, or publish them one by one with --cameras)",
        )


def _with_kept_lens(camera: IngestCamera) -> IngestCamera:
    """The lens at the camera's URL goes before that of the rig; without a rig the place of ROS's drivers is searched, too."""
    url = camera.capture.camera_info_url
    kept = load_lens(url or "", camera.name) if url or camera.of_rig is None else None
    return camera if kept is None else replace(camera, lens=kept)


def _open_recorded(camera: IngestCamera, options: SourceOptions) -> ImageSource:
    if camera.of_rig is not None and camera.lens is not None:
        known = replace(camera.of_rig, model=camera.lens, source=camera.source or None, capture=camera.capture)
        return open_camera_source(known, options)
    check_recorded(camera.source, camera.capture)
    address = camera.address
    if address.kind == BAG:
        address = topic_of_camera(address, camera.name)
    source = open_source(str(address), replace(options, capture=camera.capture))
    check_size(camera, (source.native_width, source.native_height))
    return source


def check_size(camera: IngestCamera, size: tuple[int, int]) -> None:
    """Compare the size of a source's images with the camera's calibration, if it has one.

    Parameters
    ----------
    camera : with its lens.
    size : (width, height) in pixels.

    Raises
    ------
    CalibrationError : they are not the same.
    """
    if camera.lens is not None and size != (camera.lens.width, camera.lens.height):
        expected = (camera.lens.width, camera.lens.height)
        raise CalibrationError(camera.name, size_contradiction(expected, size, camera.source))
