"""Record files with one defect, and the messages of their errors."""

import zlib
from pathlib import Path

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import read_record

HEADER = "t_s,u_V,y_um"


def lines(samples=60):
    """Return the lines of a valid record; the first line is the header, and line k + 2 holds sample k."""
    return [HEADER, *(f"{k / 100:g},{k % 7 - 3},{k * k % 11}.5" for k in range(samples))]


def refusal(tmp_path, content, inputs=("u_V",), output="y_um", name="bad.csv", **options):
    """Write lines or bytes to a file, read it as a record and return the message of the error."""
    file = tmp_path / name
    if isinstance(content, bytes):
        file.write_bytes(content)
    else:
        file.write_text("\n".join(content) + "\n", encoding="utf-8")
    with pytest.raises(RecordError) as caught:
        read_record(file, inputs, output, **options)
    return str(caught.value)


def changed(line, column, cell, samples=60):
    """Return the valid record with one cell replaced; line numbers start at 1."""
    rows = lines(samples)
    cells = rows[line - 1].split(",")
    cells[column] = cell
    rows[line - 1] = ",".join(cells)
    return rows


def archived(tmp_path, inputs=("u",), output="y", **arrays):
    k = np.arange(60)
    np.savez(tmp_path / "bad.npz", **({"u": k % 7 - 3.0, "y": k * k % 11 + 0.5, "dt": 0.01} | arrays))
    with pytest.raises(RecordError) as caught:
        read_record(tmp_path / "bad.npz", inputs, output)
    return str(caught.value)


#: Samples of each of two columns of zeros.
_BOMB_SAMPLES = 1 << 26


def write_hdf5_bomb(folder: Path) -> Path:
    """Write two columns of zeros, one compressed chunk many times."""
    import h5py

    path, part = folder / "bomb.h5", 1 << 20
    chunk = zlib.compress(bytes(8 * part), 9)
    with h5py.File(path, "w") as file:
        for name in ("u", "y"):
            column = file.create_dataset(
                name, (_BOMB_SAMPLES,), "f8", chunks=(part,), compression="gzip", compression_opts=9
            )
            for start in range(0, _BOMB_SAMPLES, part):
                column.id.write_direct_chunk((start,), chunk)
    return path


def write_mat_bomb(folder: Path) -> Path:
    """Write two columns of zeros as a MAT-file of version 5."""
    from scipy.io import savemat

    path, zeros = folder / "bomb.mat", np.zeros(_BOMB_SAMPLES)
    savemat(path, {"u": zeros, "y": zeros}, do_compression=True)
    return path


def write_parquet_bomb(folder: Path) -> Path:
    """Write two columns of zeros, which Parquet stores as the number of their repetitions."""
    import pyarrow
    from pyarrow import parquet

    path, zeros = folder / "bomb.parquet", np.zeros(_BOMB_SAMPLES)
    parquet.write_table(pyarrow.table({"u": zeros, "y": zeros}), path, compression="zstd")
    return path
