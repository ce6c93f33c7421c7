"""Names under which other programs know the landmarks of the human."""

from __future__ import annotations

from collections.abc import Iterable

_PAIRED = {
    "Shoulder": "shoulder", "Elbow": "elbow", "Wrist": "wrist", "Hip": "hip", "Knee": "knee", "Ankle": "ankle",
    "BigToe": "big_toe", "SmallToe": "small_toe", "Heel": "heel",
}  # fmt: skip

# Marker names of OpenPose and Pose2Sim TRC files -> landmarks of config/models/human.yaml
LANDMARK_OF_MARKER: dict[str, str] = {
    "Neck": "neck",
    "Head": "head",
    "Nose": "nose",
    **{f"L{marker}": f"left_{landmark}" for marker, landmark in _PAIRED.items()},
    **{f"R{marker}": f"right_{landmark}" for marker, landmark in _PAIRED.items()},
}
MARKER_OF_LANDMARK: dict[str, str] = {landmark: marker for marker, landmark in LANDMARK_OF_MARKER.items()}


def landmark_of_marker(marker: str) -> str:
    """Landmark of a marker; a marker that is not in the table keeps its own name."""
    return LANDMARK_OF_MARKER.get(marker, marker)


def mirrored_name(name: str) -> str:
    """The same part or point of the other side: ``left_knee`` for ``right_knee``; names without a side stay."""
    for side, other in (("left_", "right_"), ("right_", "left_")):
        if name.startswith(side):
            return other + name.removeprefix(side)
    return name


def known_landmarks(markers: Iterable[str], landmarks: Iterable[str]) -> dict[str, str]:
    """Marker -> landmark, of those markers that are among ``landmarks`` by either name."""
    landmarks = set(landmarks)
    pairs = {marker: landmark_of_marker(marker) for marker in markers}
    return {marker: landmark for marker, landmark in pairs.items() if landmark in landmarks}
