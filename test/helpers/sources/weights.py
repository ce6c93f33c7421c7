"""The weights of the network that finds people, if this machine has them."""

import os

import pytest

from tracker_node.errors import TrackerError
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.observation.keypoints.blazepose import BlazePoseFiles


def weights_or_skip() -> BlazePoseFiles:
    """From the user's own cache, or from the network if TRACKER_NETWORK says so; else skip."""
    pytest.importorskip("ai_edge_litert", reason="ai-edge-litert is not installed")
    with pytest.MonkeyPatch.context() as patch:
        if not os.environ.get("TRACKER_NETWORK"):
            patch.setenv("PIP_NO_INDEX", "1")
        try:
            return pose_weights()
        except TrackerError as error:
            pytest.skip(f"the weights are not in the cache, and TRACKER_NETWORK is not set ({error})")

