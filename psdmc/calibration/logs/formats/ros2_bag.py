"""Reads ROS 2 bags through the package rosbags, with or without the bag's metadata.yaml."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

from psdmc.calibration.logs.bag_sizes import (
    PACKED,
    require_mcap_size,
    require_packed_file,
    require_packed_messages,
)
from psdmc.calibration.logs.foreign_bytes import LARGEST_FILE, LARGEST_STORED, is_folder, opened
from psdmc.calibration.logs.log_format import (
    MESSAGE_TYPE,
    BagFormat,
    any_reader_messages,
    any_reader_topics,
    require_rosbags,
)
from psdmc.errors import InputError

METADATA = "metadata.yaml"
LARGEST_METADATA = 1024**2
"""Bytes of a bag's metadata.yaml, enough for thousands of topics."""
PLAIN_MODE = re.compile(r"^\s*compression_mode:\s*(['\"]?)(none|file|)\1\s*$", re.MULTILINE)
"""The line of metadata, in lower case, of a bag whose messages are not compressed one by one."""
STEPS_PER_BYTE = 100
"""SQLite's instructions per byte of a bag; ordinary bags take less than one."""
STEPS = 1_000_000
"""Instructions that every bag may take."""
MOST_TOPICS = 10_000


class Ros2BagFormat(BagFormat):
    endings = (".db3", ".mcap")
    what = "a ROS 2 bag"

    def sniff(self, path: Path) -> bool:
        """Return whether a path is a ROS 2 bag: a folder, or one of its files."""
        return super().sniff(path) or is_folder(path)

    def require_sizes(self, path: Path, held: int | None) -> None:
        for file in self._files(path):
            with opened(file, LARGEST_FILE if held is None else LARGEST_STORED):
                pass
            if file.suffix.lower() == ".mcap":
                require_mcap_size(file)
            if file.suffix.lower() == PACKED:
                require_packed_file(file)
            elif _packs_messages(file.parent):
                require_packed_messages(file)

    def topics(self, path: Path) -> tuple[str, ...]:
        return _sqlite_topics(path) if _is_bare(path) else any_reader_topics(_for_rosbags(path))

    def raw_messages(self, path: Path, topic: str) -> Iterator[bytes]:
        """Yield the serialised joint states. A single .db3 file is read as the SQLite file that it is."""
        require_rosbags()
        return (
            _sqlite_messages(path, topic)
            if _is_bare(path)
            else any_reader_messages(_for_rosbags(path), topic)
        )

    def decoded(self, raw: bytes) -> Any:
        return self._types.deserialize_cdr(raw, MESSAGE_TYPE)

    @cached_property
    def _types(self) -> Any:
        from rosbags.typesys import Stores, get_typestore

        return get_typestore(Stores.ROS2_HUMBLE)

    def _files(self, path: Path) -> tuple[Path, ...]:
        """The files that reading a bag opens; InputError where a folder is no bag."""
        if not is_folder(path):
            return (path,)
        found = tuple(
            sorted(entry for entry in path.iterdir() if entry.suffix.lower() in (*self.endings, PACKED))
        )
        if not (path / METADATA).exists():
            raise InputError(
                f"{path}: a folder without {METADATA}, so no ROS 2 bag, and without campaign.toml, so no campaign",
                f"give its file {found[0].name}" if found else "give a log, a bag or a campaign",
            )
        with opened(path / METADATA, LARGEST_METADATA):
            pass
        return found


def _is_bare(path: Path) -> bool:
    """Whether a path is a SQLite file without the bag's metadata, which rosbags does not open."""
    return path.suffix.lower() == ".db3" and not (path.parent / METADATA).exists()


def _for_rosbags(path: Path) -> Path:
    return path if is_folder(path) or path.suffix.lower() == ".mcap" else path.parent


def _packs_messages(folder: Path) -> bool:
    """Whether a bag's metadata may say that messages are compressed one by one. True in doubt: YAML has many ways."""
    try:
        with (folder / METADATA).open("rb") as file:
            text = file.read(LARGEST_METADATA).decode("utf-8", "replace").lower()
    except OSError:
        return False
    return "compression_mode" in text and PLAIN_MODE.search(text) is None


def _sqlite_topics(path: Path) -> tuple[str, ...]:
    """Topics of joint states in a bag's table `topics`."""
    with _opened_sqlite(path) as connection:
        found = connection.execute(
            "SELECT name FROM topics WHERE type = ? LIMIT ?", (MESSAGE_TYPE, MOST_TOPICS)
        )
        return tuple(dict.fromkeys(str(name) for (name,) in found))


@contextmanager
def _opened_sqlite(path: Path) -> Iterator[sqlite3.Connection]:
    """A bag as the SQLite file it is; InputError for views of its tables' names, whose evaluation might never end."""
    tables = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('messages', 'topics')"
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as connection:
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.set_progress_handler(lambda: 1, STEPS + STEPS_PER_BYTE * path.stat().st_size)
        if _count(connection, tables) != 2:
            raise InputError(
                f"{path}: not a ROS 2 bag: no tables 'messages' and 'topics'",
                "give a .db3 or .mcap file that ros2 bag recorded, or its folder",
            )
        yield connection


def _sqlite_messages(path: Path, topic: str) -> Iterator[bytes]:
    """Blobs of a bag's table `messages`."""
    query = (
        "SELECT data FROM messages JOIN topics ON topics.id = messages.topic_id "
        "WHERE topics.name = ? AND topics.type = ? ORDER BY messages.timestamp, messages.id"
    )
    with _opened_sqlite(path) as connection:
        for (data,) in connection.execute(query, (topic, MESSAGE_TYPE)):
            if not isinstance(data, bytes):
                raise InputError(
                    f"{path}: not a ROS 2 bag: a message is {type(data).__name__}, expected bytes",
                    "record the bag again",
                )
            yield data


def _count(connection: sqlite3.Connection, query: str) -> int:
    """A count; -1 where SQLite reports a lack of memory, as it does for some damaged headers."""
    try:
        return int(connection.execute(query).fetchone()[0])
    except MemoryError:
        return -1


FORMAT = Ros2BagFormat()
