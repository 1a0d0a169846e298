"""Rates of false alarms as text."""

import pytest

from islands.diagnosis.monitoring.alarm_rate import parse_alarm_rate
from islands.errors import SettingsError


@pytest.mark.parametrize(
    ("text", "interval", "rate"),
    [
        ("1 per month", 3600.0, 1 / 720),
        ("1/month", 3600.0, 1 / 720),
        ("0.5 / week", 86400.0, 0.5 / 7),
        ("2 per year", 3600.0, 2 / 8760),
        ("1 per 720 records", 60.0, 1 / 720),
        ("0.001 per record", 60.0, 1e-3),
    ],
)
def test_a_rate_is_a_number_per_record(text, interval, rate):
    assert parse_alarm_rate(text, interval) == pytest.approx(rate)


@pytest.mark.parametrize("text", ["", "often", "1 per fortnight", "1", "x per month", "1 per 0 records"])
def test_a_text_without_a_rate_is_refused_with_an_example(text):
    with pytest.raises(SettingsError, match="1 per month"):
        parse_alarm_rate(text, 3600.0)


def test_more_than_one_false_alarm_per_record_is_refused():
    with pytest.raises(SettingsError, match="below 1 per record"):
        parse_alarm_rate("1 per hour", 7200.0)
