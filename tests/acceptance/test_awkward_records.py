"""Awkward files lead to the law that is in them, or the commands announce what is wrong."""

import pytest

from support.awkward_outcomes import REFUSED, RIGHT, SILENT, assess
from support.awkward_records import AWKWARD_RECORDS

BY_TITLE = {record.title: record for record in AWKWARD_RECORDS}

#: Laws whose structure one-step least squares does not find.
OUTPUT_ERROR = ("battery", "tank")


@pytest.mark.nightly
@pytest.mark.parametrize("title", ["Russian", "outer join of two clocks"])
def test_an_awkward_file_leads_to_its_law(tmp_path, title):
    default, suggested = assess(BY_TITLE[title], 0, tmp_path)
    assert (default.kind, suggested.kind) == (RIGHT, RIGHT), (default, suggested)


@pytest.mark.ci
def test_a_file_that_is_refused_leads_to_its_law_by_the_suggested_command(tmp_path):
    default, suggested = assess(BY_TITLE["gap"], 0, tmp_path)
    assert (default.kind, suggested.kind) == (REFUSED, RIGHT), (default, suggested)


@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_nine_of_ten_files_lead_to_their_laws_and_the_others_are_announced(tmp_path):
    records = [record for record in AWKWARD_RECORDS if record.law not in OUTPUT_ERROR]
    outcomes = {}
    for place, record in enumerate(records):
        folder = tmp_path / str(place)
        folder.mkdir()
        outcomes[record.title] = assess(record, 0, folder)
    assert len(records) >= 60
    assert {title: both for title, both in outcomes.items() if SILENT in (each.kind for each in both)} == {}
    right = [title for title, (default, _) in outcomes.items() if default.kind == RIGHT]
    assert len(right) >= 0.9 * len(records)
