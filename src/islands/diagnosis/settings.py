"""Settings of a diagnosis and of a monitor."""

from typing import Annotated

from pydantic import AfterValidator, Field

from islands.diagnosis.monitoring.alarm_rate import parse_alarm_rate
from islands.errors import SettingsError
from islands.settings_schema import Integer, setting, setting_of, settings_class

#: Interval at which every rate per time is below one per record.
_SHORT_INTERVAL = 1e-9


def _check_rate(text: str) -> str:
    # It is checked again with the interval between the records, which may be that of the first one.
    try:
        parse_alarm_rate(text, _SHORT_INTERVAL)
    except SettingsError as error:
        raise ValueError(str(error)) from error
    return text


_Name = Annotated[str, Field(min_length=1, max_length=200)]

#: Relative standard deviations of parameters, by name.
Tolerances = dict[_Name, Annotated[float, Field(gt=0, lt=1)]]

#: Rate of false alarms.
AlarmRate = Annotated[str, Field(max_length=100), AfterValidator(_check_rate)]


@settings_class
class DiagnosisSettings:
    """Settings of a diagnosis."""

    tolerance: Tolerances = setting(
        {},
        "Relative standard deviations of parameters about their nominal values, by name, 0.02 for 2 %. Other "
        "parameters are calibrated without a prior.",
        daily=True,
        max_length=100,
    )
    noise_level: float | None = setting(
        None,
        "Standard deviation of the noise of the output, in its unit. A residual of more than twice this is "
        "no noise.",
        gt=0,
        daily=True,
    )


@settings_class
class MonitoringSettings:
    """Settings of a monitor."""

    tolerance: Tolerances = setting_of(DiagnosisSettings, "tolerance", daily=True)
    false_alarms: AlarmRate = setting(
        "1 per month",
        "Rate of false alarms of all monitored values together, such as 1 per month, 0.1/week or 1 per 720 "
        "records.",
        daily=True,
    )
    interval: float | None = setting(
        None,
        "Time from one record to the next; by default by the times in the names of files, or the duration of "
        "the first record.",
        gt=0,
        unit="s",
    )
    training: Integer = setting(
        24, "Number of first records that are the undisturbed state.", ge=12, le=10_000
    )
