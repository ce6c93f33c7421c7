"""People in a few image sets of a recording, detected in the whole images: nobody knows yet where the body is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

from ...camera.rig import CameraRig
from ...observation.image_set import ImageSet
from ...observation.keypoints.crop import Crop
from ...tracking.modality import PeopleSeen
from .detection import Expecting

FindPeople = Callable[[Expecting, ImageSet], ImageSet]


class Recording(Protocol):
    """Image sets of a rig, such as an `ImageSetStream`; ``n_expected``: how many, where that is known."""

    @property
    def rig(self) -> CameraRig: ...

    @property
    def n_expected(self) -> int | None: ...

    def __iter__(self) -> Iterator[ImageSet]: ...


class _Anywhere:
    """Expects nobody at any place."""

    def __init__(self, n_cameras: int):
        self._n_cameras = n_cameras

    def expected_crops(self, stamp_ns: int) -> list[tuple[Crop, ...]]:
        return [()] * self._n_cameras


def people_of_sets(
    recording: Recording, n_sets: int, find: FindPeople, progress: Callable[[str, int, int], None] = lambda *_: None
) -> list[PeopleSeen]:
    """Everybody in some image sets, spread over a recording.

    Parameters
    ----------
    recording : its first sets are taken where its length is not known.
    n_sets : image sets, at most.
    find : `with_people` of a `PeopleDetection`, or of `RecordedPeople`.
    progress : called with what is done, how often it has been done, and how often it will be.

    Returns
    -------
    By image set and camera, empty where a camera has no image.
    """
    n = min(n_sets, recording.n_expected or n_sets)
    wanted = {k * (recording.n_expected or n) // n for k in range(n)}
    nowhere, found = _Anywhere(len(recording.rig)), list[PeopleSeen]()
    for row, image_set in enumerate(recording):
        if row in wanted:
            seen = find(nowhere, image_set)
            of_camera = {image.camera: image.people or () for image in seen.images}
            found.append([of_camera.get(name, ()) for name in recording.rig.names])
            progress("people", len(found), n)
            if len(found) == n:
                break
    return found
