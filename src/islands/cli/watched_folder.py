"""Folder into which records are written: its complete files, each of them once, in the order of recording."""

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

from islands.errors import SettingsError
from islands.records.reading import READERS
from islands.records.reading.formats.packed import PACKED

#: Date and time in a file name: 2026-11-23T01-30, 20261123_0130, 2026-11-23 01:30:05.
_TIME = re.compile(
    r"(?<!\d)(\d{4})[-_.]?(\d{2})[-_.]?(\d{2})(?:[T_ -]?(\d{2})[-_.:h]?(\d{2})(?:[-_.:m]?(\d{2}))?)?(?!\d)"
)


def find_time(name: str) -> str:
    """Return the time in a file name, ISO 8601 without a time zone; empty if there is none."""
    for match in _TIME.finditer(name):
        try:
            year, month, day, hour, minute, second = (int(part or 0) for part in match.groups())
            return datetime(year, month, day, hour, minute, second, tzinfo=UTC).isoformat()[:19]
        except ValueError:
            continue
    return ""


def order_of_recording(path: Path) -> tuple[str, list[tuple[int, str]]]:
    """Return the sorting key of a file: the time in its name, then the name with numbers by their value."""
    parts = [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]
    return find_time(path.name), parts


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@dataclass(slots=True)
class WatchedFolder:
    """Files of a folder that are complete.

    A file is complete once its size and its time of modification have not changed for a number of seconds;
    only then it is read. A file that is written again later is a new one.

    Attributes
    ----------
    folder : Path
    settle : float
        Number of seconds.
    """

    folder: Path
    settle: float
    _seen: dict[Path, tuple[tuple[int, int], float]] = field(default_factory=dict)
    _taken: dict[Path, tuple[int, int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.folder.is_dir():
            raise SettingsError(f"{self.folder} is no folder: give the folder that records are written into")

    def take_complete(self, now: float) -> Iterator[Path]:
        """Yield the files that are complete and have not been taken, in the order of recording.

        Parameters
        ----------
        now : float
            Present time in seconds, of the clock of the file system.
        """
        for path in self._list_files():
            mark = self._mark(path)
            if mark is None or self._taken.get(path) == mark:
                continue
            known, since = self._seen.get(path, (None, now))
            if known != mark:
                since = min(mark[1] / 1e9, now)
                # A file in which data appear between two looks is young, whatever its time of modification.
                since = now if known is not None else since
                self._seen[path] = (mark, since)
            if now - since >= self.settle:
                self._taken[path] = mark
                yield path

    @property
    def interval(self) -> float | None:
        """Median time between the files in seconds, by the times in their names; None without two of them."""
        times = [find_time(path.name) for path in self._list_files()]
        stamps = [datetime.fromisoformat(f"{each}+00:00").timestamp() for each in times if each]
        between = sorted(after - before for before, after in pairwise(stamps) if after > before)
        return between[len(between) // 2] if between else None

    @property
    def has_unfinished(self) -> bool:
        """Whether files are being written, or are too young to know."""
        return any(
            (mark := self._mark(path)) is not None and self._taken.get(path) != mark
            for path in self._list_files()
        )

    def _list_files(self) -> list[Path]:
        suffixes = {*READERS, *PACKED}
        found = (path for path in self.folder.iterdir() if path.suffix.lower() in suffixes)
        return sorted(
            (path for path in found if path.is_file() and not path.name.startswith(".")),
            key=order_of_recording,
        )

    @staticmethod
    def _mark(path: Path) -> tuple[int, int] | None:
        try:
            found = path.stat()
        except FileNotFoundError:  # removed since the folder was listed
            return None
        return found.st_size, found.st_mtime_ns
