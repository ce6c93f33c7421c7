"""What became of a camera's images: every one that is not published has a reason."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass
class CameraCounts:
    """Counts since the start, for /diagnostics and the last line of the node."""

    published: int = 0
    dropped: int = 0  # left out to keep the rate: published later, they would have delayed newer ones
    skipped: int = 0  # not even decoded as a whole: their time was over
    late: int = 0  # published more than half a period after their time
    duplicated: int = 0  # same pixels as the image before (published all the same)
    missing: int = 0  # announced by the file, but not there
    unusable: int = 0  # of another size than the calibration, or damaged
    unstamped: int = 0  # second fields before the rate was known
    connections: int = 0  # to a live source

    def values(self) -> dict[str, int]:
        """The counts by name."""
        return asdict(self)
