"""Sizes on the command line."""

import argparse

import pytest

from tracker_node.cli.arguments.cameras import image_size, size_option
from tracker_node.errors import FileFormatError


@pytest.mark.parametrize(("text", "size"), [("640x480", (640, 480)), ("1X2", (1, 2))])
def test_two_numbers_with_an_x_between_them(text, size):
    assert image_size(text) == size == size_option("--size", text)


BAD = ["", "640", "640x", "x480", "640x480x3", "-1x2", "1.5x2", "0x480", " 1x2", "²x2", "9" * 5000 + "x2"]


@pytest.mark.parametrize("text", BAD, ids=lambda text: text[:9])
def test_anything_else_is_named(text):
    with pytest.raises(argparse.ArgumentTypeError, match="expected WIDTHxHEIGHT"):
        image_size(text)
    with pytest.raises(FileFormatError, match="'--size': expected WIDTHxHEIGHT"):
        size_option("--size", text)


def test_boards_have_bounds():
    assert size_option("--charuco", "3x100", "a board", 3, 100) == (3, 100)
    for text in ("2x5", "5x101"):
        with pytest.raises(FileFormatError, match="'--charuco': expected a board, got"):
            size_option("--charuco", text, "a board", 3, 100)
