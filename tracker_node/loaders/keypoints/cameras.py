"""Which files of points belong to which camera of a rig, by their names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from ...errors import UnknownNameError


def match_files(keys: Iterable[str], cameras: Sequence[str]) -> dict[str, str]:
    """Files or folders of points by camera.

    The first rule that fits one file alone counts: the camera's name (``cam01``, ``cam01_json``); its name as a word, or at the
    end (``trial2_cam01``, ``walk-camA`` for ``A``); its last number (``cam1`` for ``cam_01``). A single file belongs to a single
    camera whatever its name.

    Parameters
    ----------
    keys, cameras : names of files or folders; names of the cameras.

    Returns
    -------
    Camera -> file; cameras without one are absent.

    Raises
    ------
    UnknownNameError : no camera has one, with the files that there are; or two cameras have the same.
    """
    keys = list(keys)
    if len(keys) == len(cameras) == 1:
        return {cameras[0]: keys[0]}
    found = {}
    for camera in cameras:
        word = re.compile(rf"(?<![^\W_]){re.escape(camera)}(?![^\W_])", re.IGNORECASE)
        rules = (
            [key for key in keys if key in (camera, f"{camera}_json")],
            [key for key in keys if word.search(key)],
            [key for key in keys if key.endswith(camera)],
            [key for key in keys if _number(camera) is not None and _number(key) == _number(camera)],
        )
        alone = next((fitting[0] for fitting in rules if len(fitting) == 1), None)
        if alone is not None:
            found[camera] = alone
    if not found or len(set(found.values())) < len(found):
        raise UnknownNameError("files of points for the cameras", ", ".join(cameras), keys)
    return found


def _number(name: str) -> int | None:
    numbers = re.findall(r"\d{1,18}", name)
    return int(numbers[-1]) if numbers else None
