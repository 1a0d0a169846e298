"""Records that a confined process reads are those that a direct reading gives, bit for bit."""

import io
import json
from dataclasses import fields

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import read_dataset
from islands.records.reading.options import ReadingOptions
from islands_service.intake import confined_answer
from islands_service.intake.record_reading import (
    RecordRequest,
    read_confined,
    receive_record,
    send_record,
)
from support.odd_files import ODD_FILES

MEMORY, SECONDS = 6_000_000_000, 30.0

#: One file of every format, and two that are refused.
CHOSEN = {
    f"{case.name} {case.title}": case
    for case in reversed(ODD_FILES)
    if not case.name.endswith((".zip", ".gz", ".mf4", ".mdf", ".docx"))
}
BY_FORMAT = {case.name: case for case in CHOSEN.values() if not case.words} | {
    case.title: case for case in ODD_FILES if case.title in ("gap", "text in a cell")
}


def read(path, case):
    options = dict(case.options)
    dt, rows = options.pop("dt", None), options.pop("rows", None)
    return read_dataset(path, case.columns[:1], case.columns[1], dt, rows, options=ReadingOptions(**options))


def same(one, other):
    """Return whether two records are equal bit for bit."""
    return all(
        np.array_equal(ours.view(np.int64), theirs.view(np.int64))
        if isinstance(ours, np.ndarray)
        else (type(ours), ours) == (type(theirs), theirs)
        for field in fields(one)
        for ours, theirs in [(getattr(one, field.name), getattr(other, field.name))]
    )


@pytest.mark.parametrize("case", [pytest.param(case, id=title) for title, case in CHOSEN.items()])
def test_a_record_is_received_as_it_was_sent(tmp_path, case):
    path = tmp_path / case.name
    case.write(path)
    try:
        record = read(path, case)
    except RecordError:
        return
    stream = io.BytesIO()
    send_record(record, stream)
    stream.seek(0)
    assert same(receive_record(stream), record)


@pytest.mark.ci
@pytest.mark.parametrize("case", [pytest.param(case, id=title) for title, case in BY_FORMAT.items()])
def test_a_confined_process_reads_every_format_as_a_direct_reading_does(tmp_path, case):
    path = tmp_path / case.name
    case.write(path)
    reading = {name: value for name, value in case.options.items() if name not in ("dt", "rows")}
    request = RecordRequest(case.columns[:1], case.columns[1], case.options.get("dt"), None, reading)
    if case.words:
        with pytest.raises(RecordError) as direct:
            read(path, case)
        with pytest.raises(RecordError) as confined:
            read_confined(path, request, MEMORY, SECONDS)
        assert str(confined.value) == str(direct.value)
    else:
        assert same(read_confined(path, request, MEMORY, SECONDS), read(path, case))


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"[]\n",
        b'{"shape": [1000000000000, 1]}\n',
        b'{"shape": [-1, 2]}\n01234567',
        json.dumps({"shape": [2, 1], "dt": "fast"}).encode() + b"\n" + bytes(32),
    ],
)
def test_an_answer_that_is_not_a_record_is_refused(answer):
    with pytest.raises(RecordError, match="has answered nonsense"):
        receive_record(io.BytesIO(answer))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("while True: pass", "takes longer than 1 s to read"),
        ("raise ValueError('boom')", r"cannot be read within 6.0 GB of memory and 1 s \(ValueError: boom\)"),
    ],
)
def test_a_process_that_fails_is_a_clear_error(tmp_path, monkeypatch, programs, program, words):
    path = tmp_path / "a.csv"
    path.touch()
    monkeypatch.setattr(confined_answer, "FORK_SERVER", programs(program))
    with pytest.raises(RecordError, match=words):
        read_confined(path, RecordRequest(["u"], "y", None, None, {}), MEMORY, 1.0)
