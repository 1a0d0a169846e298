"""Mutated files are read or refused by every reader, and the search for defects finds planted ones."""

import io
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import nptdms
import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import read_record
from support.odd_files import write_workbook
from support.repository import ROOT

#: The cases are the same at every run; `make fuzz` takes others every day.
SEED = 1


@pytest.mark.ci
def test_every_reader_survives_mutated_files() -> None:
    command = [sys.executable, "-m", "lab.fuzzing.readers", "--cases", "40", "--seed", str(SEED)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    for suffix in (".csv", ".npz", ".mat", ".h5", ".xlsx", ".parquet", ".tdms", ".mf4"):
        assert f"{suffix:10} {40:9,} cases" in done.stdout


def _header_without_end(path: Path) -> None:
    stream = io.BytesIO()
    np.save(stream, np.arange(60.0))
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("u_V", "y_um"):
            archive.writestr(f"{name}.npy", stream.getvalue().replace(b"}", b" "))


def _directory_of_a_workbook(path: Path) -> None:
    write_workbook(path)
    path.write_bytes(path.read_bytes().replace(b"PK\1\2", b"PK\1\3"))


def _too_many_values(path: Path) -> None:
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("g", name, np.arange(61.0)) for name in ("u_V", "y_um")])
    count, wrong = (number.to_bytes(8, "little") for number in (61, 2**63))
    path.write_bytes(path.read_bytes().replace(count, wrong))


def _name_that_is_not_utf_8(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file[b"\xff\xfe"] = np.arange(60.0)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("r.npz", _header_without_end),
        ("r.xlsx", _directory_of_a_workbook),
        ("r.h5", _name_that_is_not_utf_8),
        ("r.tdms", _too_many_values),
    ],
)
def test_a_damage_that_libraries_do_not_expect_is_refused(
    tmp_path: Path, name: str, write: Callable[[Path], None]
) -> None:
    """Found by mutations: the library raised another exception than for other damages."""
    write(tmp_path / name)
    with pytest.raises(RecordError, match=r"damaged|write it again|save it again"):
        read_record(tmp_path / name, ["u_V"], "y_um")
