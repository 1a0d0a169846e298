"""Files of a folder: only complete ones, each once, in the order of recording."""

import os

import pytest

from islands.cli.watched_folder import WatchedFolder, find_time
from islands.errors import SettingsError

NOW = 1_800_000_000.0


def write(path, text="x", age=60.0):
    path.write_text(text)
    os.utime(path, (NOW - age, NOW - age))
    return path


def names(watched, now=NOW):
    return [path.name for path in watched.take_complete(now)]


def test_files_come_in_the_order_of_recording_and_once(tmp_path):
    for name in ("run10.csv", "run9.csv", "note.md", ".hidden.csv", "run11.csv.part"):
        write(tmp_path / name)
    watched = WatchedFolder(tmp_path, 2.0)
    assert names(watched) == ["run9.csv", "run10.csv"]
    assert names(watched) == []
    assert not watched.has_unfinished


def test_a_file_that_grows_is_not_read(tmp_path):
    watched = WatchedFolder(tmp_path, 2.0)
    path = write(tmp_path / "a.csv", "1", age=0.5)
    assert names(watched) == []
    assert watched.has_unfinished
    path.write_text("12")
    os.utime(path, (NOW - 0.5, NOW + 1.0))
    assert names(watched, NOW + 1.9) == []
    assert names(watched, NOW + 3.0) == []
    assert names(watched, NOW + 4.0) == ["a.csv"]


@pytest.mark.parametrize(
    ("name", "time"),
    [
        ("press_2026-11-23T01-30.csv", "2026-11-23T01:30:00"),
        ("20261123_013005.csv", "2026-11-23T01:30:05"),
        ("2026-11-23.csv", "2026-11-23T00:00:00"),
        ("serial 20269999.csv", ""),
        ("run7.csv", ""),
    ],
)
def test_the_time_is_read_from_the_name(name, time):
    assert find_time(name) == time


def test_a_path_without_a_folder_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="no folder"):
        WatchedFolder(tmp_path / "none", 2.0)
