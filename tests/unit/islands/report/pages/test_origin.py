"""Origin of a result: what the head of a report states."""

from datetime import date

from islands.distribution import read_version
from islands.report.pages.origin import Origin

HASH = "0123456789abcdef" * 4


def test_facts_are_those_that_are_known():
    version = f"islands {read_version()}"
    assert Origin("r.csv").list_facts(HASH) == [version, "data set 0123456789ab"]
    known = Origin("r.csv", date(2024, 2, 29), "alice", "f00")
    assert known.list_facts(HASH) == [
        *("2024-02-29", version, "data set 0123456789ab", "owner alice", "job f00")
    ]
