"""JSON of points with one value replaced, taken out or moved, and H5 that is strange: read, or refused with file and field."""

import json
import pickle
import random

import numpy as np
import pytest

from helpers.fuzz.mutations import damage_content
from helpers.sources import point_files as files
from tracker_node.errors import FileFormatError
from tracker_node.loaders.keypoints import coco, mediapipe, openpose
from tracker_node.loaders.keypoints.formats import load_points

PARTS = ("nose", "left_paw", "right_paw", "tail")


def some_json(folder, kind):
    """A valid file, and its reader."""
    if kind == "openpose":
        file = next(files.write_openpose(folder / "cam1", files.some_people(17)[:1]).iterdir())
        return file, lambda path: openpose.read(path.parent)
    if kind == "mmpose images":
        file = next(files.write_mmpose_images(folder / "cam1", files.some_people(17)[:1]).iterdir())
        return file, lambda path: coco.of_mmpose(path.parent)
    if kind == "mmpose":
        return files.write_mmpose_video(folder / "a.json", files.some_people(4), PARTS), coco.of_mmpose
    if kind == "mediapipe":
        file = files.write_mediapipe_json(folder / "a.json", files.some_people(33), 640, 480)
        return file, lambda path: {"a": mediapipe.of_json(path)}
    return files.write_coco(folder / "a.json", files.some_people(17)), lambda path: {"a": coco.of_coco(path)}


@pytest.mark.parametrize("kind", ["openpose", "mmpose images", "mmpose", "mediapipe", "coco"])
def test_json_with_one_thing_wrong(tmp_path, kind):
    path, load = some_json(tmp_path, kind)
    valid, rng, refused = json.loads(path.read_text()), random.Random(kind), 0
    for _ in range(150):
        path.write_text(json.dumps(damage_content({"all": valid}, rng).get("all"), default=str), errors="replace")
        try:
            for camera in load(path).values():
                people = camera.camera().for_images(640, 480)
                for found in people.values():
                    assert all(np.isfinite(person.pixels).all() and np.isfinite(person.covariances).all() for person in found)
        except FileFormatError as error:
            refused += 1
            assert str(tmp_path) in str(error) and error.field and "\n" not in str(error)
    assert refused > 30


def test_names_of_points_that_would_run_a_program(tmp_path):
    """PyTables keeps names as pickles; of these no class is looked up."""
    import h5py

    class Runs:
        def __reduce__(self):
            return open, (str(tmp_path / "made"), "w")

    path = files.write_deeplabcut_h5(tmp_path / "a.h5", files.some_people(4, n_people=1), PARTS)
    with h5py.File(path, "a") as file:
        file["df_with_missing/table"].attrs["values_block_0_kind"] = np.bytes_(pickle.dumps([Runs()], 0))
    with pytest.raises(FileFormatError, match=r"names in plain lists, got 'an object"):
        load_points(path)
    assert not (tmp_path / "made").exists()


def test_data_in_other_files(tmp_path):
    import h5py

    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["tracks"] = np.zeros((1, 2, 1, 1))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["node_names"] = [b"a"]
        file["tracks"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "/tracks")
    with pytest.raises(FileFormatError, match="a link to another file"):
        load_points(tmp_path / "a.h5")
    (tmp_path / "raw").write_bytes(bytes(16))
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["node_names"] = [b"a"]
        file.create_dataset("tracks", (1, 2, 1, 1), "f8", external=[(str(tmp_path / "raw"), 0, 16)])
    with pytest.raises(FileFormatError, match="data in another file"):
        load_points(tmp_path / "b.h5")


def test_more_than_a_machine_holds(tmp_path):
    """Some bytes that stand for terabytes."""
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["node_names"] = [b"a"]
        file.create_dataset("tracks", (1000, 2, 1, 10**9), "f8", chunks=(1, 2, 1, 1000))
    with pytest.raises(FileFormatError, match="tracks': expected at most 1000 MB, got '16000000 MB'"):
        load_points(tmp_path / "a.h5")


@pytest.mark.parametrize("text", ["", "track,frame_idx\n", "scorer,a\n", "scorer,a,a\nbodyparts,b,b\ncoords,x,x\n0,1,2\n"])
def test_tables_without_what_they_need(tmp_path, text):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(FileFormatError, match=r"a\.csv"):
        load_points(tmp_path / "a.csv")


def test_two_files_of_one_camera(tmp_path):
    for name in ("cam1.csv", "cam1DLC_x.csv"):
        files.write_deeplabcut_csv(tmp_path / name, files.some_people(4), PARTS, ("a", "b"))
    with pytest.raises(FileFormatError, match=r"one file for camera 'cam1', got 'cam1.* as well'"):
        load_points(tmp_path)
