"""JSON and XML read strictly, and numbers for JSON, which knows none that are not finite."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

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


def parse_xml(content: str | bytes, file: str | Path) -> ElementTree.Element:
    """Top element of an XML text.

    Parameters
    ----------
    content, file : text, or bytes that say their encoding; file, for messages.

    Returns
    -------
    The element with all below it.

    Raises
    ------
    FileFormatError : no XML, with line and column; an encoding that is not known; an entity that is declared.
    """
    parser = expat.ParserCreate(namespace_separator="}")  # as ElementTree, which does not let declarations be seen

    def refuse(*_: object) -> NoReturn:  # no program writes entities, and they can grow without bound
        place = f"line {parser.CurrentLineNumber}, column {parser.CurrentColumnNumber + 1}"
        raise FileFormatError(file, place, "XML without entities of its own", "one")

    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
        return ElementTree.fromstring(content)
    except (expat.ExpatError, ElementTree.ParseError) as error:
        line, column = error.position if isinstance(error, ElementTree.ParseError) else (error.lineno, error.offset)
        raise FileFormatError(file, f"line {line}, column {column + 1}", "XML", str(error).partition(":")[0]) from None
    except (ValueError, LookupError) as error:  # an encoding that Python does not know, or of several bytes
        raise FileFormatError(file, "(file)", "XML", str(error)) from None


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
