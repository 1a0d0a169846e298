"""Costly text files are read or refused in a time that grows in proportion to their size."""

import pytest

from islands.errors import RecordError
from islands.facade.inspect_record import inspect_record
from support.hostile_tables import FAMILIES, reading_seconds

#: Largest growth of the time when the size is doubled twice.
LARGEST_RATIO = 2.2**2

#: Families whose files exceed a limit; reading the file ends at once.
EXCESSIVE = (
    "digits in a cell",
    "blanks in a cell",
    "quotes",
    "only quotes",
    "quotes and separators",
    "only separators",
    "mixed separators",
    "one line of numbers",
    "one line of letters",
    "one line of digits",
    "one name",
    "names of times",
    "names above short lines",
    "a quote in the header that is never closed",
)


@pytest.mark.parametrize("family", EXCESSIVE)
def test_a_file_that_exceeds_a_limit_is_refused_with_its_place(tmp_path, family):
    path = tmp_path / "r.csv"
    path.write_text(FAMILIES[family](240_000))
    with pytest.raises(RecordError, match=r"^r\.csv(, line \d+| has more than 10000 columns)") as caught:
        inspect_record(path)
    assert len(str(caught.value)) < 500


def is_proportional(path, family, size, repetitions):
    """Return whether four times the size takes about four times as long at most."""
    times = []
    for each in (size, 4 * size):
        path.write_bytes(FAMILIES[family](each).encode())
        times.append(reading_seconds(inspect_record, path, repetitions))
    # Below 50 ms the time is that of the start of the table and of the message.
    return times[1] < 0.05 or times[1] <= LARGEST_RATIO * times[0]


#: Families of the level ci: cells, lines, headers, comments and quotes. The others resemble them.
FEW = (
    *("digits in a cell", "dates", "separators", "quotes and separators", "names above short lines"),
    *("a quote in the header that is never closed", "comments", "numbers with points and commas", "columns"),
)


@pytest.mark.ci
@pytest.mark.parametrize(
    "family",
    [each if each in FEW else pytest.param(each, marks=pytest.mark.nightly) for each in FAMILIES],
)
def test_the_time_grows_in_proportion_to_the_size(tmp_path, family):
    """Larger files decide where the first measurement shows no proportion.

    The smaller of the first two files may fit into a cache of the processor that the larger one exceeds.
    """
    path = tmp_path / "r.csv"
    assert is_proportional(path, family, 125_000, 1) or is_proportional(path, family, 500_000, 3)
