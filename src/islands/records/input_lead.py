"""Inputs that are read one sample early, for an output that responds within the sample."""

from collections.abc import Sequence
from dataclasses import replace

from islands.errors import SettingsError
from islands.records.channel_names import AT_ONCE, parse_channel_name
from islands.records.dataset import Dataset

#: Value of the setting ``feedthrough`` that tests the record.
AUTO = "auto"

#: Values of the setting ``feedthrough``.
FEEDTHROUGH = (AUTO, "yes", "no")


def advance_inputs(record: Dataset, places: Sequence[int]) -> Dataset:
    """Return a record with some inputs read one sample early, so that their u(k-1) is the input at sample k.

    Their names get the suffix ``+1``. The last value of every segment is repeated; no prediction uses it.

    Parameters
    ----------
    record : Dataset
    places : sequence of int
        Indices of the inputs, from 0. The record itself is returned if there are none.
    """
    if not places:
        return record
    u = record.u.copy()
    for begin, end in record.bounds:
        for place in places:
            u[begin : end - 1, place] = record.u[begin + 1 : end, place]
    names = tuple(
        name + AT_ONCE if place in places else name for place, name in enumerate(record.input_names)
    )
    return replace(record, u=u, input_names=names)


def advance_all_inputs(record: Dataset) -> Dataset:
    """Return a record with all inputs read one sample early; see `advance_inputs`."""
    names = enumerate(record.input_names)
    return advance_inputs(record, [place for place, name in names if not parse_channel_name(name).at_once])


def check_feedthrough(feedthrough: str) -> None:
    """Check the setting ``feedthrough``.

    Raises
    ------
    SettingsError
        It is none of `FEEDTHROUGH`.
    """
    if feedthrough not in FEEDTHROUGH:
        raise SettingsError(
            f"feedthrough is auto, yes or no, got {feedthrough!r}; to choose among several inputs, take no "
            f"and name the input u{AT_ONCE}"
        )
