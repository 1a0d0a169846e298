"""Inspection of a file and of a record in memory: equal facts, with that about a linear model last."""

import pytest

import islands
from support.known_records import delay, lag, measure, steps


@pytest.mark.ci
def test_a_file_and_a_record_in_memory_have_the_same_facts(tmp_path):
    u = steps(400, 0, 10)
    record = measure(u, delay(lag(u, 5.0), 3), 0.02)
    islands.write_record(record, tmp_path / "r.csv")
    again = islands.read_record(tmp_path / "r.csv", inputs=record.input_names, output=record.output_name)
    names = list(record.input_names), record.output_name
    found = islands.inspect_record(tmp_path / "r.csv", *names), islands.inspect_record(again)
    one, other = ([fact.as_document() for fact in each.facts.facts] for each in found)
    assert one == other
    assert one[-1]["name"] == "linear"
    assert one[-1]["value"] is True
    assert "of order 1 with a dead time of" in one[-1]["sentence"]
