"""Pictures of other files: colors in their order, gray ones, and what is refused."""

import cv2
import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.picture_file import read_picture, write_picture

PICTURE = np.random.default_rng(0).integers(0, 256, (4, 6, 3), dtype=np.uint8)


def test_a_picture_is_there_and_back(tmp_path):
    write_picture(PICTURE, tmp_path / "a.png")
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png", "m.yaml", "texture"), PICTURE)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "a.png"))[..., ::-1], PICTURE)  # red first, blue last


def test_gray_is_read_as_three_alike(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), PICTURE[..., 0])
    found = read_picture(tmp_path / "a.png", "m.yaml", "texture")
    assert found.shape == (4, 6, 3)
    for channel in range(3):
        np.testing.assert_array_equal(found[..., channel], PICTURE[..., 0])


@pytest.mark.parametrize(
    ("picture", "got"),
    [(np.zeros((3, 4, 4), np.uint8), "4 channels of 8 bits"), (np.zeros((3, 4, 3), np.uint16), "3 channels of 16 bits"),
     (np.zeros((3, 4), np.uint16), "3 channels of 16 bits")],
)  # fmt: skip
def test_other_pictures_are_refused(tmp_path, picture, got):
    cv2.imwrite(str(tmp_path / "a.png"), picture)
    with pytest.raises(FileFormatError, match=f"m.yaml.*texture.*{got}"):
        read_picture(tmp_path / "a.png", "m.yaml", "texture")


def test_files_that_are_none(tmp_path):
    with pytest.raises(FileFormatError, match="an existing picture"):
        read_picture(tmp_path / "a.png", "m.yaml", "texture")
    (tmp_path / "a.png").write_text("no picture")
    with pytest.raises(FileFormatError, match="a readable picture"):
        read_picture(tmp_path / "a.png", "m.yaml", "texture")
