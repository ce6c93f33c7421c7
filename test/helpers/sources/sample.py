"""The sample recording, if this machine has it."""

import os
from pathlib import Path

import pytest

from tracker_node.errors import SourceError
from tracker_node.loaders.fetched_files import fetch_sample


def sample_or_skip() -> dict[str, Path]:
    """Files of the Balancing clip from the user's own cache, or from the network if TRACKER_NETWORK says so; else skip."""
    with pytest.MonkeyPatch.context() as patch:
        if not os.environ.get("TRACKER_NETWORK"):
            patch.setenv("PIP_NO_INDEX", "1")
        try:
            return fetch_sample("balancing")
        except SourceError as error:
            pytest.skip(f"the sample is not in the cache, and TRACKER_NETWORK is not set ({error})")
