"""`inspect_file`: a harmful file affects only the process that reads it."""

import asyncio
import os
import re
import signal
import subprocess
import sys
import threading
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import RecordError
from islands_service.intake import confined_answer
from islands_service.intake.confined_process import ENVIRONMENT
from islands_service.intake.file_inspection import (
    InspectionRequest,
    count_slots,
    describe_file,
    find_limits,
    inspect_file,
)
from islands_service.intake.record_reading import RecordRequest, read_confined
from islands_service.settings import ServiceSettings
from support.odd_files import write_workbook
from support.processes import alive, descendants, eventually
from support.service import csv

MEMORY, SECONDS = 6_000_000_000, 30.0

#: Styles of the cells of a workbook.
NO_STYLE = re.compile(rb"<cellStyleXfs.*</cellStyleXfs>")

#: Writes files after the limits are set.
WRITES = """
import sys
from islands_service.intake.confined_process import limit_resources
limit_resources(6_000_000_000, 30.0)
for path in sys.argv[1:]:
    try:
        with open(path, "w") as stream:
            stream.write("harm")
    except OSError as error:
        print(error.errno)
"""
SETTINGS = ServiceSettings()


def inspect(path, asked=None, memory=MEMORY, seconds=SECONDS):
    return asyncio.run(inspect_file(path, asked or InspectionRequest(), memory, seconds))


def inspections():
    """Return the processes that a fork server of this process has forked."""
    servers = [pid for pid, line in descendants(os.getpid()).items() if "intake.fork_server" in line]
    return [pid for server in servers for pid in descendants(server)]


@pytest.fixture
def record(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(csv())
    return path


@pytest.fixture
def endless(tmp_path):
    """A named pipe, so that reading never ends."""
    path = tmp_path / "a.csv"
    os.mkfifo(path)
    return path


@pytest.mark.ci
def test_messages_that_a_library_prints_are_no_part_of_the_answer(tmp_path):
    """The reader of workbooks prints the number of a style that does not exist."""
    write_workbook(tmp_path / "a.xlsx")
    with zipfile.ZipFile(tmp_path / "a.xlsx") as whole, zipfile.ZipFile(tmp_path / "b.xlsx", "w") as broken:
        for name in whole.namelist():
            broken.writestr(name, NO_STYLE.sub(b"<cellStyleXfs/>", whole.read(name)))
    with pytest.raises(RecordError, match=r"b\.xlsx is damaged"):
        inspect(tmp_path / "b.xlsx")
    with pytest.raises(RecordError, match=r"b\.xlsx is damaged"):
        read_confined(tmp_path / "b.xlsx", RecordRequest(["u"], "y", None, None, {}), MEMORY, SECONDS)


@pytest.mark.parametrize("asked", [InspectionRequest(), InspectionRequest(("u",), "y")])
def test_assumptions_about_the_time_are_warnings(tmp_path, asked):
    """Days are read as days, and an output that is held for five rows has a clock of five rows."""
    u = np.repeat(np.random.default_rng(1).normal(size=100), 7)
    y = np.repeat(np.convolve(u, np.ones(9) / 9, "same")[::5], 5)
    rows = (f"{45987.5 + k / 1440:.9f},{u[k]},{y[k]}" for k in range(700))
    (tmp_path / "a.csv").write_text("\n".join(["Date,u,y", *rows]))
    found = describe_file(tmp_path / "a.csv", asked)
    assert found["dt"] == 60.0
    days, clocks = found["warnings"]
    assert "column Date is read as days: 45987.5 is 2025-11-26 12:00:00" in days
    assert "y every 300 s (held between them)" in clocks


def test_a_record_without_a_choice_of_columns_has_the_reason(tmp_path):
    (tmp_path / "a.csv").write_text("\n".join(["t_s,name,y", *(f"{k},a,{k % 7}" for k in range(100))]))
    found = describe_file(tmp_path / "a.csv", InspectionRequest())["inspection"]
    assert (found["choice"]["output"], found["facts"]) == ("", [])
    assert found["choice"]["reason"].startswith("Only y is a signal")


def test_missing_cells_are_refused_in_an_input_and_skipped_in_an_output(tmp_path):
    (tmp_path / "a.csv").write_bytes(csv(u_V={7: ""}, y_um={9: ""}))
    with pytest.raises(RecordError, match="line 7, column u_V is empty or NaN: give gaps="):
        describe_file(tmp_path / "a.csv", InspectionRequest(("u_V",)))
    found = describe_file(tmp_path / "a.csv", InspectionRequest((), "y_um"))
    assert [(each["missing"], each["problem"]) for each in found["columns"]] == [(0, ""), (1, ""), (1, "")]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (
            InspectionRequest(("u_V",), "y_um", dt=0.02),
            "the sampling time is 0.01 s by column t_s and 0.02 s",
        ),
        (
            InspectionRequest(("u_V",), "y_um", rows="150:250"),
            "has samples 0 to 199: rows 150:250 are not a part of it",
        ),
        (InspectionRequest(("u_V",), "y_um", rows="5:1"), "rows 5:1 are not a part of it"),
        (InspectionRequest(("u_V",), "y_um", rows="0:20"), "20 samples, from line 2 to line 21, are too few"),
        (InspectionRequest(("force",), "y_um"), "a.csv has no column force"),
        (InspectionRequest(("force",)), "no column force; it has t_s, u_V, y_um"),
        (InspectionRequest(("u_V+1",), "y_um", rows="-20:"), "are too few"),
    ],
)
def test_requested_columns_and_rows_are_checked(record, asked, words):
    with pytest.raises(RecordError) as refused:
        inspect(record, asked)
    assert words in str(refused.value)


def test_a_file_that_takes_too_much_memory_ends_the_process(record):
    with pytest.raises(RecordError, match=r"a\.csv cannot be read within 0\.1 GB of memory and 30 s \(.+\)"):
        inspect(record, memory=100_000_000)


def test_a_file_that_takes_too_long_ends_the_process(endless):
    began = time.monotonic()
    with pytest.raises(RecordError, match=r"a\.csv takes longer than 1 s to read: give a shorter record"):
        inspect(endless, seconds=1.0)
    assert time.monotonic() - began < 20.0
    assert not alive(inspections())


def test_process_has_no_secrets_and_no_files_of_the_service(endless, tmp_path, monkeypatch):
    monkeypatch.setenv("ISLANDS_DATABASE", "postgresql+psycopg://me:secret@host/islands")
    (tmp_path / "islands.db").touch()

    async def run():
        task = asyncio.create_task(inspect_file(endless, InspectionRequest(), MEMORY, SECONDS))
        while not (found := inspections()) or _limits(found[0])["Max file size"] != ["0", "0"]:
            await asyncio.sleep(0.01)
        (pid,) = found
        process = Path(f"/proc/{pid}")
        entries = (process / "environ").read_bytes().split(b"\0")
        environment = dict(entry.split(b"=", 1) for entry in entries if entry)
        opened = _opened(pid)
        limits = _limits(pid)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return environment, opened, limits

    with (tmp_path / "islands.db").open("rb"):
        environment, opened, limits = asyncio.run(run())
    assert environment.keys() <= {name.encode() for name in (*ENVIRONMENT, "ISLANDS_READERS")}
    assert not [path for path in opened if path.endswith(".db") or path.startswith("socket")]
    assert limits["Max address space"] == [str(MEMORY)] * 2
    assert limits["Max cpu time"] == ["31", "31"]
    assert limits["Max open files"] == ["64", "64"]
    assert limits["Max core file size"] == ["0", "0"]


def _opened(pid):
    """Return the open files of a process, which may change meanwhile."""
    opened = []
    for path in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(OSError):
            opened.append(str(path.readlink()))
    return opened


def _limits(pid):
    lines = Path(f"/proc/{pid}/limits").read_text().splitlines()[1:]
    return {line[:26].strip(): line[26:].split()[:2] for line in lines}


def test_process_cannot_write_files(tmp_path):
    new = tmp_path / "new"
    done = subprocess.run(
        [sys.executable, "-c", WRITES, new], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.stdout == "27\n"  # EFBIG
    assert new.stat().st_size == 0


@pytest.mark.ci
def test_the_service_and_other_owners_are_not_delayed_by_the_slow_files_of_one(serve):
    stopped = set()

    def stop_reader():
        """Suspend an inspection while it reads."""
        for pid in inspections():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGSTOP)
                stopped.add(pid)
        return len(alive(stopped)) == 1

    with serve(require_keys=True) as service:
        slow, other = (service.key(owner=owner) for owner in ("slow", "other"))
        uploads = [
            threading.Thread(target=service.upload, args=(csv(2000 + n), f"{n}.csv", slow)) for n in range(3)
        ]
        for upload in uploads:
            upload.start()
        eventually(stop_reader)
        assert service.upload(csv(), "other.csv", other).status_code == 201
        assert service.client.get("/v1/jobs", headers=other).status_code == 200
        assert inspections() == alive(stopped)
        os.kill(stopped.pop(), signal.SIGCONT)
        for upload in uploads:
            upload.join()
        assert len(service.client.get("/v1/datasets", headers=slow).json()["items"]) == 3


def test_an_endless_answer_is_refused(record, monkeypatch, programs):
    monkeypatch.setattr(confined_answer, "FORK_SERVER", programs("while True: print('0' * 65536)"))
    monkeypatch.setattr(confined_answer, "_MAX_OUTPUT", 1_000_000)
    with pytest.raises(RecordError, match="it is damaged, or unpacks to more"):
        inspect(record)


@pytest.mark.ci
def test_a_file_without_a_record_has_no_facts(tmp_path):
    np.savez(tmp_path / "one.npz", y=np.random.default_rng(0).random(100), dt=0.01)
    found = inspect(tmp_path / "one.npz")["inspection"]
    assert found["facts"] == []
    assert found["choice"]["reason"].startswith("Only y is a signal")


def test_a_file_of_two_megabytes_unpacks_to_two_hundred():
    """A gigabyte, the most that any file may have, would take its reader a minute."""
    limits = find_limits(2_000_000, SETTINGS)
    assert limits.unpacked == 200_000_000
    assert limits.memory < 3_000_000_000
    assert limits.slots == 4


@given(st.integers(0, 10**10), st.integers(1, 10**10), st.integers(1, 10**11))
def test_no_file_exceeds_the_settings_and_a_larger_one_has_no_less(received, most, memory):
    settings = SETTINGS.model_copy(update={"max_unpacked": most, "inspection_memory": memory})
    small, large = find_limits(received, settings), find_limits(2 * received, settings)
    assert small.unpacked <= large.unpacked <= most
    assert small.memory <= large.memory <= memory
    assert 1 <= small.slots <= large.slots <= count_slots(most)
