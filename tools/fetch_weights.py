"""Fetch the weights of the network that finds points of people, checked by their sums; without network say so, and go on.

    .venv/bin/python tools/fetch_weights.py
"""

from tracker_node.errors import TrackerError
from tracker_node.loaders.fetched_files import pose_weights

if __name__ == "__main__":
    try:
        pose_weights()
    except TrackerError as error:
        print(f"Not set up: points of people; whatever needs them tries again. {error}")
