"""JSON read strictly, and numbers for JSON, which knows none that are not finite."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from .whole_file import JSON_BYTES, read_text


def read_json(path: str | Path) -> Any:
    """Content of a JSON file.

    Raises
    ------
    FileFormatError : a file that cannot be read or is larger than `JSON_BYTES`, or `parse_json` refuses.
    """
    return parse_json(read_text(path, JSON_BYTES), path)


def parse_json(text: str | bytes, file: str | Path) -> Any:
    """Values of a JSON text.

    Parameters
    ----------
    text, file : content; file, for messages.

    Returns
    -------
    Plain values.

    Raises
    ------
    FileFormatError : no JSON, not in UTF-8, lists in lists without end, or numbers of thousands of digits.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise FileFormatError(file, "(content)", "JSON", "lists or mappings nested without end") from None
    except ValueError as error:
        raise FileFormatError(file, "(content)", "JSON", str(error)) from None


def finite(value: float) -> float | None:
    """A number; None for one that is not finite."""
    return float(value) if math.isfinite(value) else None


def finite_list(values: np.ndarray, digits: int) -> list[Any]:
    """An array for JSON.

    Parameters
    ----------
    values, digits : of any shape; digits after the point that are kept.

    Returns
    -------
    Nested lists; None for numbers that are not finite.
    """
    rounded = np.round(values, digits).astype(object)
    rounded[~np.isfinite(values)] = None
    listed: list[Any] = rounded.tolist()
    return listed
