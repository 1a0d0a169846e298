"""Recordings of one system that a command reads."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from islands.cli.console import print_message
from islands.errors import SettingsError
from islands.records.channel_names import parse_channel_name
from islands.records.coupled import AnyRecord, couple, join_columns, split_first, unite
from islands.records.dataset import Dataset, join
from islands.records.input_lead import advance_inputs
from islands.records.preprocessing import preprocess
from islands.records.preprocessing_steps import NO_STEPS, PreprocessingSteps
from islands.records.reading import read_dataset
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.row_range import overlap, parse_rows
from islands.records.split import describe_extrapolation

#: Fraction of every recording that is used for validation.
FRACTION = 0.25


def _measured_names(inputs: Sequence[str], steps: PreprocessingSteps) -> Sequence[str]:
    """Return the columns to read before some steps: a filter and a decimation need inputs as measured."""
    return [parse_channel_name(name).base for name in inputs] if steps.has_rate_steps else inputs


def _advance_as_named(record: Dataset, inputs: Sequence[str]) -> Dataset:
    """Return a record with those inputs advanced whose given names say so (``u_V+1``)."""
    pairs = zip(inputs, record.input_names, strict=False)
    early = [(parse_channel_name(name).at_once, parse_channel_name(own).at_once) for name, own in pairs]
    return advance_inputs(record, [place for place, (given, own) in enumerate(early) if given and not own])


def state_extrapolation(data: AnyRecord, held_out: AnyRecord | float) -> None:
    """Print, before a search, which inputs of the validation data leave the range of the estimation data."""
    for statement in describe_extrapolation(split_first(data, held_out)):
        print_message(f"Validation extrapolates: {statement}.")


def parse_held_out(text: str | None, option: str = "--validation") -> Path | str | float | None:
    """Read the value of an option for validation data: a file, rows of the record, or a fraction of its end.

    Raises
    ------
    SettingsError
        The text is none of the three.
    """
    if text is None:
        return None
    if Path(text).exists():
        return Path(text)
    if ":" in text:
        return text
    try:
        return float(text)
    except ValueError:
        raise SettingsError(
            f"{option} {text}: give a file that exists, a fraction such as 0.25, or rows START:STOP"
        ) from None


@dataclass(frozen=True, slots=True)
class Recordings:
    """Files with recordings of one system, their columns, and how they are read.

    Attributes
    ----------
    paths : sequence of Path
        Files, one for each recording.
    inputs : sequence of str
        Input columns. Those that are read one sample early (``u_V+1``) are advanced after the steps.
    outputs : sequence of str
        Output columns.
    dt : float, optional
        Sampling time in seconds, for files that do not contain it.
    reading : ReadingOptions
    steps : PreprocessingSteps
        Steps of all recordings. The offsets are those of the estimation data.
    resting_inputs : bool
        Accept constant inputs.
    signals : sequence of str
        Inputs that are outputs of a simulation, as in `read_table`.
    """

    paths: Sequence[Path]
    inputs: Sequence[str]
    outputs: Sequence[str]
    dt: float | None = None
    reading: ReadingOptions = DEFAULT_READING
    steps: PreprocessingSteps = NO_STEPS
    resting_inputs: bool = False
    signals: Sequence[str] = ()

    def read(self, rows: str | None = None) -> AnyRecord:
        """Read ``START:STOP`` of every recording, or all of it, join the recordings and preprocess them."""
        return self._read_measured(rows).map(
            lambda each: _advance_as_named(preprocess(each, **asdict(self.steps)), self.inputs)
        )

    def _read_measured(self, rows: str | None) -> AnyRecord:
        joined = join(tuple(self._read_file(path, rows) for path in self.paths))
        return couple(joined, len(self.outputs))

    def read_held_out(
        self, text: str | None, used: str | None = None, option: str = "--validation"
    ) -> AnyRecord | float:
        """Read ``--validation``: a fraction of each recording's end, other rows of each, or another file.

        Parameters
        ----------
        text : str or None
            Value of the option. None is the default fraction.
        used : str, optional
            The ``--rows`` used for estimation. Validation rows must not overlap them.
        option : str
            Name of the option in messages; ``--test`` is read in the same way.

        Raises
        ------
        SettingsError
            The text is none of the three, or the rows overlap those used for estimation.
        """
        match parse_held_out(text, option):
            case Path() as path:
                return self._preprocess_held_out(couple(self._read_file(path), len(self.outputs)), used)
            case str() as rows:
                if used is None or overlap(parse_rows(used), parse_rows(rows)):
                    raise SettingsError(
                        f"{option} {rows}: give --rows START:STOP, other samples for estimation"
                    )
                return self._preprocess_held_out(self._read_measured(rows), used)
            case fraction:
                return FRACTION if fraction is None else fraction

    def _preprocess_held_out(self, record: AnyRecord, used: str | None) -> AnyRecord:
        """Do the steps with the offsets of the estimation data."""
        if self.steps.is_none:
            return record
        pairs = zip(record.records, self.read(used).records, strict=True)
        return unite([_advance_as_named(preprocess(each, like=like), self.inputs) for each, like in pairs])

    def _read_file(self, path: Path, rows: str | None = None) -> Dataset:
        columns, output = join_columns(_measured_names(self.inputs, self.steps), self.outputs)
        return read_dataset(
            path,
            columns,
            output,
            self.dt,
            parse_rows(rows),
            options=self.reading,
            resting_inputs=self.resting_inputs,
            signals=self.signals,
        )
