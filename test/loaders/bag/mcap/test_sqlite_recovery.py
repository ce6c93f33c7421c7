"""SQLite files of bags: topics, rows that are damaged, and what a writer that was killed leaves."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.mcap.contents import FileContents, RawMessage
from tracker_node.loaders.bag.mcap.sqlite_recovery import scan_sqlite

TOPICS = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT{})"
MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"


def made(path: Path, *rows: tuple, new: bool = True) -> Path:
    with closing(sqlite3.connect(path)) as db:
        db.execute(TOPICS.format(", offered_qos_profiles TEXT, type_description_hash TEXT" if new else ""))
        db.execute(MESSAGES)
        for number, name, kind in ((4, "/a", "p/msg/A"), (6, "/b", "p/msg/B"), (7, "/c", "p/msg/A")):
            values = (number, name, kind, "cdr", *(("qos of " + name, "hash of " + name) if new else ()))
            db.execute(f"INSERT INTO topics VALUES ({', '.join('?' * len(values))})", values)
        if new:
            columns = "id INTEGER, topic_type TEXT, encoding TEXT, encoded_message_definition TEXT"
            db.execute(f"CREATE TABLE message_definitions({columns})")
            db.execute("INSERT INTO message_definitions VALUES (1, 'p/msg/B', 'ros2msg', 'int8 b')")
        db.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows)
        db.commit()
    return path


def test_messages_and_topics(tmp_path):
    path = made(tmp_path / "a.db3", (2, 6, 50, b"two"), (1, 4, 90, b"one"))
    contents = FileContents()
    assert list(scan_sqlite(path, contents)) == [RawMessage(4, 90, 90, b"one"), RawMessage(6, 50, 50, b"two")]
    assert contents.indexed and contents.problems == []
    assert {number: channel.topic for number, channel in contents.channels.items()} == {4: "/a", 6: "/b", 7: "/c"}
    a, b, c = (contents.channels[number] for number in (4, 6, 7))
    assert a.schema_id == c.schema_id != b.schema_id and a.message_encoding == "cdr" and a.id == 4
    assert a.metadata == {"offered_qos_profiles": "qos of /a", "topic_type_hash": "hash of /a"}
    assert len(contents.schemas) == 2 and contents.schemas[a.schema_id].id == a.schema_id
    of_a, of_b = contents.schemas[a.schema_id], contents.schemas[b.schema_id]
    assert (of_a.name, of_a.encoding, of_a.data) == ("p/msg/A", "", b"")
    assert (of_b.name, of_b.encoding, of_b.data) == ("p/msg/B", "ros2msg", b"int8 b")


def test_older_files_say_less(tmp_path):
    contents = FileContents()
    assert len(list(scan_sqlite(made(tmp_path / "a.db3", (1, 4, 90, b"x"), new=False), contents))) == 1
    assert contents.channels[4].metadata == {"offered_qos_profiles": "", "topic_type_hash": ""}
    assert contents.schemas[1].data == b"" and contents.problems == []


@pytest.mark.parametrize("row", [(2, 5, 50, b"x"), (2, 4, "soon", b"x"), (2, 4, 50, "text"), (2, 4, None, b"x")])
def test_rows_that_are_no_messages_are_left_out(tmp_path, row):
    contents = FileContents()
    path = made(tmp_path / "a.db3", (1, 4, 90, b"one"), row, (3, 4, 95, b"three"))
    assert [message.data for message in scan_sqlite(path, contents)] == [b"one", b"three"]
    assert contents.problems == ["a damaged row was left out"]


def test_rows_on_damaged_pages_are_left_out(tmp_path):
    """Each row has pages of its own; the one page that lists them all stays."""
    rows = [(i, 4, 100 + i, bytes([i]) * 3000) for i in range(1, 9)]
    path = made(tmp_path / "a.db3", *rows)
    data = bytearray(path.read_bytes())
    page = data.index(bytes([5]) * 1000) // 4096
    data[4096 * page : 4096 * page + 8] = b"\xff" * 8  # the head of the page
    path.write_bytes(bytes(data))
    contents = FileContents()
    stamps = [message.stamp_ns - 100 for message in scan_sqlite(path, contents)]
    assert stamps == [1, 2, 3, 4, 6, 7, 8]
    assert len(contents.problems) == 1 and contents.problems[0].startswith("pages are damaged: ")


def test_a_transaction_that_was_not_finished_is_read_without_changing_the_files(tmp_path):
    path = made(tmp_path / "a b?.db3", (1, 4, 90, b"one"))
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("INSERT INTO messages VALUES (2, 4, 95, 'x')")
        db.execute("UPDATE messages SET data = ? WHERE id = 2", (b"two",))
        db.commit()
        (tmp_path / "copy").mkdir()
        for end in ("", "-wal"):
            (tmp_path / "copy" / (path.name + end)).write_bytes(path.with_name(path.name + end).read_bytes())
    copy = tmp_path / "copy" / path.name
    before = {file.name: file.read_bytes() for file in copy.parent.iterdir()}
    contents = FileContents()
    assert [message.data for message in scan_sqlite(copy, contents)] == [b"one", b"two"]
    assert contents.problems == ["the file was not closed by its writer"]
    assert {file.name: file.read_bytes() for file in copy.parent.iterdir()} == before


def test_files_that_are_no_bags(tmp_path):
    path = tmp_path / "a.db3"
    for content in (b"no database at all, but long enough to be looked at" * 20, b""):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match=r"field '\(file\)': expected a SQLite file of a bag, got '"):
            list(scan_sqlite(path, FileContents()))
    with pytest.raises(FileFormatError, match="a SQLite file of a bag"):
        list(scan_sqlite(tmp_path / "none.db3", FileContents()))
