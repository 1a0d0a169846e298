"""Mutations of valid record files, and their execution by a reader in a process with limits.

A mutated file is read, or refused with an error for its owner. Anything else is a defect: another exception,
a crash, a case that takes seconds.
"""

import io
import json
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import numpy as np

from islands.errors import IslandsError
from support.odd_files import ODD_FILES, OddFile, T, U, Y

#: Largest number of seconds of one case.
SLOW = 5.0

#: Bytes of address space of a process of cases.
MEMORY = 4_000_000_000

#: Texts and numbers that parsers treat specially.
TOKENS = (
    *(
        b"",
        b"nan",
        b"inf",
        b"-inf",
        b"1e309",
        b"1e-400",
        b"0x1p3",
        b"1_000",
        b"--1",
        b'"',
        b"''",
        b",",
        b";",
        b"\t",
        b"\r",
    ),
    *(
        b"\n",
        b"\0",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"\xe2\x80\xa8",
        b"9" * 400,
        b"t_s",
        b"u_V",
        b"#",
        b"%",
        b"=",
    ),
    *(
        bytes(8),
        b"\xff" * 8,
        (2**31).to_bytes(8, "little"),
        (2**63).to_bytes(8, "little"),
        b"PK\1\2",
        b"PK\3\4",
    ),
)

#: Times in the properties of a workbook.
_DATE = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")


@dataclass(frozen=True)
class Defect:
    """A case that was neither read nor refused."""

    suffix: str
    seed: int
    case: int
    reason: str


def write_parquet(path: Path) -> None:
    """Write the record of the corpus as Parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"t_s": T, "u_V": U, "y_um": Y}), path)


def write_mat_73(path: Path) -> None:
    """Write the record of the corpus in the HDF5 format of MATLAB."""
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in (("t_s", T), ("u_V", U), ("y_um", Y)):
            file[name] = values[None]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")


def write_mdf(path: Path) -> None:
    """Write the record of the corpus as MDF, with the same bytes at every run."""
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.start_time = datetime(2026, 1, 1, tzinfo=UTC)
        file.append([Signal(U, T, name="u", unit="V"), Signal(Y, T, name="y", unit="um")])
        file.save(path, overwrite=True)


#: Files in addition to those of the corpus.
FURTHER = (
    OddFile("Parquet", "r.parquet", write_parquet),
    OddFile("MAT 7.3", "r.mat", write_mat_73),
    OddFile("MDF", "r.mf4", write_mdf),
)


@cache
def corpus(suffix: str) -> tuple[bytes, ...]:
    """Return the contents of the files of a format."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number, file in enumerate((*ODD_FILES, *FURTHER)):
            if file.name.lower().endswith(suffix):
                path = Path(folder) / f"{number}-{file.name}"
                file.write(path)
                found.append(_remove_dates(path.read_bytes()))
    return tuple(found)


def _remove_dates(content: bytes) -> bytes:
    """Return a file without the time of its writing, so that its mutations are the same at every run."""
    if content.startswith(b"MATLAB 5.0"):
        return b"MATLAB 5.0 MAT-file".ljust(116) + content[116:]
    if content.startswith(b"MDF"):
        at = content.index(b"##FH") + 40  # the time of the block of the file's history
        return content[:at] + bytes(8) + content[at + 8 :]
    try:
        members = _read_members(content)
    except zipfile.BadZipFile:
        return content
    return _write_members([(name, _DATE.sub(b"2026-01-01T00:00:00Z", data)) for name, data in members])


def _read_members(content: bytes) -> list[tuple[str, bytes]]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return [(name, archive.read(name)) for name in archive.namelist()]


def _write_members(members: list[tuple[str, bytes]]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members:
            info = zipfile.ZipInfo(name)  # of the year 1980
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, data)
    return stream.getvalue()


def mutate(suffix: str, seed: int, case: int) -> bytes:
    """Return the content of a case: a file of the corpus with some mutations."""
    rng = random.Random(f"{suffix} {seed} {case}")
    content = rng.choice(corpus(suffix))
    if zipfile.is_zipfile(io.BytesIO(content)) and rng.random() < 0.7:
        return _mutate_members(content, rng)
    return _mutate_bytes(content, rng, corpus(suffix))


def _mutate_bytes(content: bytes, rng: random.Random, others: tuple[bytes, ...]) -> bytes:
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4, 8))):
        at = rng.randrange(len(data) + 1)
        end = min(len(data), at + rng.choice((1, 2, 8, 64, 1024)))
        match rng.randrange(6):
            case 0 if at < len(data):
                data[at] ^= 1 << rng.randrange(8)
            case 1 if at < len(data):
                data[at] = rng.randrange(256)
            case 2:
                del data[at:end]
            case 3:
                data[at:at] = data[at:end]
            case 4:
                data[at : at + rng.choice((0, 8))] = rng.choice(TOKENS)
            case _:
                other = rng.choice(others)
                begin = rng.randrange(len(other) + 1)
                data[at:end] = other[begin : begin + end - at]
    return bytes(data[: rng.randrange(len(data) + 1)] if rng.random() < 0.05 else data)


def _mutate_members(content: bytes, rng: random.Random) -> bytes:
    """Mutate the unpacked members of an archive, whose checksums are then right."""
    members = _read_members(content)
    chosen = rng.randrange(len(members))
    name, data = members[chosen]
    members[chosen] = name, _mutate_bytes(data, rng, (data,))
    return _write_members(members)


def run_cases(
    read: Callable[[Path], object], suffix: str, seed: int, cases: range, folder: Path
) -> Iterator[Defect | None]:
    """Run cases in this process; yield a defect or None for each."""
    for case in cases:
        path = folder / f"case{suffix}"
        path.write_bytes(mutate(suffix, seed, case))
        # The signal ends the process, also in a loop of a library that never returns.
        signal.setitimer(signal.ITIMER_REAL, 2.0 * SLOW)
        began = time.perf_counter()
        try:
            read(path)
        except IslandsError:
            pass
        except MemoryError:
            pass  # the service tells the owner that the limit is reached
        except Exception:
            yield Defect(suffix, seed, case, traceback.format_exc())
            continue
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        seconds = time.perf_counter() - began
        yield Defect(suffix, seed, case, f"it took {seconds:.1f} s") if seconds > SLOW else None


def main() -> None:
    """Run the cases that standard input names, as a child process of `lab/fuzzing/readers.py`."""
    from islands.records.reading import preview

    asked = json.load(sys.stdin)
    # Libraries print messages.
    answer = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    corpus(asked["suffix"])
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    cases = range(asked["first"], asked["first"] + asked["cases"])
    with tempfile.TemporaryDirectory(dir=asked["folder"]) as folder:
        for case, defect in zip(
            cases, run_cases(preview, asked["suffix"], asked["seed"], cases, Path(folder)), strict=True
        ):
            reason = None if defect is None else defect.reason
            print(json.dumps({"case": case, "reason": reason}), file=answer, flush=True)


if __name__ == "__main__":
    main()
