"""Reads ROS 1 bags (rosbag, format 2.0) through the package rosbags."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from psdmc.calibration.logs.bag_sizes import require_ros1_sizes
from psdmc.calibration.logs.foreign_bytes import LARGEST_FILE, LARGEST_STORED, opened
from psdmc.calibration.logs.log_format import (
    MESSAGE_TYPE,
    BagFormat,
    any_reader_messages,
    any_reader_topics,
)


class Ros1BagFormat(BagFormat):
    endings = (".bag",)
    what = "a ROS 1 bag"

    def require_sizes(self, path: Path, held: int | None) -> None:
        with opened(path, LARGEST_FILE if held is None else LARGEST_STORED) as file:
            require_ros1_sizes(file, path)

    def topics(self, path: Path) -> tuple[str, ...]:
        return any_reader_topics(path)

    def raw_messages(self, path: Path, topic: str) -> Iterator[bytes]:
        return any_reader_messages(path, topic)

    def decoded(self, raw: bytes) -> Any:
        return self._types.deserialize_ros1(raw, MESSAGE_TYPE)

    @cached_property
    def _types(self) -> Any:
        from rosbags.typesys import Stores, get_typestore

        return get_typestore(Stores.ROS1_NOETIC)


FORMAT = Ros1BagFormat()
