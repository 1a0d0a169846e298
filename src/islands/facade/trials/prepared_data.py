"""Data of a search: at its sampling rate, with the inputs of direct paths read one sample early."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from islands.facade.trials.feedthrough_selection import advance_split, select_feedthrough
from islands.facade.trials.library import TrialLibrary
from islands.facade.trials.rate_selection import select_rate
from islands.progress import Steps
from islands.records.channel_names import parse_channel_name
from islands.records.split import Split, average_split


@dataclass(frozen=True, slots=True)
class PreparedData:
    """Estimation data and validation data that all models of a search share.

    Attributes
    ----------
    split : Split
    average : int
        Number of samples of the record whose mean is one sample.
    early : tuple of int
        Places of the inputs that are read one sample early because the output responds within the sample.
    """

    split: Split
    average: int = 1
    early: tuple[int, ...] = ()

    @property
    def is_early(self) -> bool:
        """Whether all inputs are read one sample early."""
        return all(parse_channel_name(name).at_once for name in self.split.estimation.input_names)

    def to_document(self) -> dict[str, Any]:
        """Return what `restore_data` needs, as JSON values."""
        return {"average": self.average, "early": list(self.early)}


def prepare_data(
    split: Split,
    average: int | str,
    feedthrough: str,
    library: TrialLibrary,
    least: int,
    steps: Steps,
) -> PreparedData:
    """Choose the sampling rate and the inputs that are read early, as the settings say.

    Parameters
    ----------
    split : Split
        Data at the rate of the record.
    average : int or str
        See `select_rate`.
    feedthrough : str
        See `select_feedthrough`.
    library : TrialLibrary
        Library and constraints of the models that are compared.
    least : int
        Fewest samples of a segment that permit a prediction.
    steps : Steps

    Raises
    ------
    StoppedError, SettingsError, RecordError
        As of `select_rate` and `select_feedthrough`.
    """
    steps("sampling rate and direct feedthrough", 0.0)
    averaged, count = select_rate(split, average, library, least, steps)
    advanced = select_feedthrough(averaged, feedthrough, library.at_rate(count))
    pairs = zip(averaged.estimation.input_names, advanced.estimation.input_names, strict=True)
    early = tuple(place for place, (before, after) in enumerate(pairs) if before != after)
    return PreparedData(advanced, count, early)


def restore_data(split: Split, document: Mapping[str, Any]) -> PreparedData:
    """Prepare data as a document of `PreparedData` states.

    Raises
    ------
    KeyError, TypeError, ValueError
        The document is damaged.
    """
    count, early = int(document["average"]), tuple(map(int, document["early"]))
    return PreparedData(advance_split(average_split(split, count), early), count, early)
