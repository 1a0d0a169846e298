"""Messages of the process that reads untrusted files."""

import json

import pytest

from islands.errors import RecordError
from islands_service.intake.confined_process import ConfinedTask, check_status


def message(status: int, answer: bytes = b"", complaint: bytes = b"") -> str:
    with pytest.raises(RecordError) as caught:
        check_status(status, answer, complaint, ConfinedTask("a.csv"), 10**9, 5.0)
    return str(caught.value)


def test_failure_of_the_reader_is_described_without_paths() -> None:
    trace = b"Traceback\nFileNotFoundError: [Errno 2] No such file: '/srv/islands/blobs/ab'\n"
    assert "(FileNotFoundError)" in message(1, complaint=trace)
    assert "(MemoryError: 3 GB)" in message(1, complaint=b"Traceback\nMemoryError: 3 GB\n")
    assert "(exit -9)" in message(-9)


def test_refusal_of_the_reader_is_passed_on() -> None:
    assert message(3, json.dumps({"error": "line 7 is wrong"}).encode()) == "line 7 is wrong"
    check_status(0, b"", b"", ConfinedTask("a.csv"), 10**9, 5.0)
