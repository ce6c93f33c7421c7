"""What can be read from a SQLite file of a bag, whatever its condition: its writer was killed, pages are damaged."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

from mcap.records import Channel, Schema

from ....errors import FileFormatError
from .contents import MOST_BYTES, FileContents, RawMessage

_BESIDE = ("-wal", "-journal")  # what an unfinished transaction leaves
_ROWS = "SELECT id, topic_id, timestamp, data FROM messages"


def scan_sqlite(path: Path, contents: FileContents) -> Iterator[RawMessage]:
    """All messages in the order of writing; topics and the problems found go to ``contents``.

    Raises
    ------
    FileFormatError : no SQLite file of a bag, or not readable.
    """
    contents.indexed = True
    try:
        with _opened(path, contents) as db:
            _read_topics(db, contents)
            for channel, stamp_ns, data in _rows(db, contents):
                if channel in contents.channels and isinstance(stamp_ns, int) and isinstance(data, bytes):
                    yield RawMessage(channel, stamp_ns, stamp_ns, data)
                else:
                    contents.problems.append("a damaged row was left out")
    except (sqlite3.Error, OSError, ValueError, OverflowError, MemoryError) as error:
        raise FileFormatError(path, "(file)", "a SQLite file of a bag", str(error)) from None


@contextmanager
def _opened(path: Path, contents: FileContents) -> Iterator[sqlite3.Connection]:
    """The database as its last whole transaction left it; nothing is changed on the disk."""
    beside = [path.with_name(path.name + end) for end in _BESIDE if path.with_name(path.name + end).exists()]
    with TemporaryDirectory() as folder:
        if beside:
            contents.problems.append("the file was not closed by its writer")
            for file in (path, *beside):
                shutil.copyfile(file, Path(folder, file.name))
            address = f"file:{quote(str(Path(folder, path.name)))}"
        else:
            address = f"file:{quote(str(path.absolute()))}?immutable=1"
        with closing(sqlite3.connect(address, uri=True)) as db:
            db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
            db.execute("PRAGMA trusted_schema = OFF")
            db.text_factory = lambda data: data.decode(errors="replace")
            yield db


def _read_topics(db: sqlite3.Connection, contents: FileContents) -> None:
    columns = {row[1] for row in db.execute("PRAGMA table_info(topics)")}
    optional = [name if name in columns else "''" for name in ("offered_qos_profiles", "type_description_hash")]
    definitions = _definitions(db)
    for number, name, type_name, qos, type_hash in db.execute(f"SELECT id, name, type, {', '.join(optional)} FROM topics"):
        schema = next((key for key, schema in contents.schemas.items() if schema.name == type_name), len(contents.schemas) + 1)
        encoding, text = definitions.get(type_name, ("", ""))
        contents.schemas[schema] = Schema(id=schema, data=str(text).encode(), encoding=encoding, name=str(type_name))
        metadata = {"offered_qos_profiles": str(qos), "topic_type_hash": str(type_hash)}
        contents.channels[number] = Channel(number, str(name), "cdr", metadata, schema)


def _definitions(db: sqlite3.Connection) -> dict[str, tuple[str, str]]:
    """Type name -> encoding and text; from Iron on they are in the file."""
    try:
        rows = db.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions").fetchall()
    except sqlite3.Error:
        return {}
    return {name: (encoding, text) for name, encoding, text in rows}


def _rows(db: sqlite3.Connection, contents: FileContents) -> Iterator[tuple]:
    """Topic, time and data, row by row where pages are damaged."""
    last = 0
    try:
        for number, *row in db.execute(f"{_ROWS} ORDER BY id"):
            last = number
            yield tuple(row)
        return
    except sqlite3.DatabaseError as error:
        contents.problems.append(f"pages are damaged: {error}")
    try:
        (end,) = db.execute("SELECT max(id) FROM messages").fetchone()
    except sqlite3.DatabaseError:
        return
    for number in range(last + 1, (end or 0) + 1):
        try:
            row = db.execute(f"{_ROWS} WHERE id = ?", (number,)).fetchone()
        except sqlite3.DatabaseError:
            continue
        if row:
            yield row[1:]
