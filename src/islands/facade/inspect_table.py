"""Columns, sampling and facts of an open file, before a model is sought."""

import re
import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import (
    RecordError,
    join_text,
    name_option,
    write_setting,
)
from islands.records.channel_names import parse_unit
from islands.records.dataset import Dataset
from islands.records.inspection.column_roles import ColumnChoice, choose_columns
from islands.records.inspection.findings import InspectedColumn, InspectedSampling, RecordInspection
from islands.records.inspection.gross_errors import find_input_codes
from islands.records.inspection.record_facts import RecordFacts, measure_facts
from islands.records.inspection.record_note import MOST_ROWS, RecordNote, make_note
from islands.records.inspection.stamp_regularity import NO_BREAKS, TimeStamps, describe_stamps
from islands.records.inspection.static_curve import describe_static_curve, is_static_curve
from islands.records.reading.column_names import find_column, split_structures
from islands.records.reading.open_table import exclude_gross_errors, read_table
from islands.records.reading.options import DEFAULT_READING, EXCLUDE, KEEP, ROWS, SAMPLE, ReadingOptions
from islands.records.reading.preview import ColumnPreview, Preview
from islands.records.reading.sampling.column_clocks import find_clocks, may_differ
from islands.records.reading.sampling.common_clock import ColumnUse, align_columns, merge_notes
from islands.records.reading.sampling.recording import Recording
from islands.records.reading.sampling.time_step import TimeSource, find_time_scale
from islands.records.reading.sampling.time_unit import TimeScale
from islands.records.reading.table import Columns, Table
from islands.records.reading.validation import MIN_SAMPLES, check_choice

#: Columns that are read to choose inputs and output, at most.
_MOST_COLUMNS = 32

#: Remark on a file without a sampling time.
_NO_SAMPLING_TIME = "The sampling time is unknown: the facts count a sample as one second."

#: Samples that columns of different clocks have in common, at least, to be compared at these.
_LEAST_ALIGNED = 100

#: Samples of a part without gaps that facts are measured on, at least.
_LEAST_PART = 20


def inspect_table(
    table: Table,
    path: str | Path,
    found: Preview,
    inputs: Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
    rows: slice | None = None,
    reading: ReadingOptions = DEFAULT_READING,
) -> RecordInspection:
    """Describe an open file as `inspect_record` does, but for the fact about a linear model.

    Parameters
    ----------
    table : Table
        The columns of the file.
    path : str or Path
        The file.
    found : Preview
        Its preview.
    inputs, output, dt, rows, reading
        As in `inspect_record`.

    Raises
    ------
    RecordError
        As in `inspect_record`.
    """
    inputs = (inputs,) if isinstance(inputs, str) else tuple(inputs)
    path = Path(path)
    if inputs and output is not None:
        sources = [find_column(name, table.names) for name in inputs]
        target = find_column(output, table.names)
        check_choice(table.names, sources, target, path.name, reading.time, table.others)
    return _FileInspection(path, table, found, dt, rows, reading).inspect(inputs, output)


def describe_values(
    name: str, unit: str, role: str, values: NDArray[np.float64], problem: str = ""
) -> InspectedColumn:
    """Describe a column of a record by its values."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (None, None)
    return InspectedColumn(name, unit, role, low, high, int(values.size - known.size), problem)


@dataclass(frozen=True, slots=True)
class _FileInspection:
    path: Path
    table: Table
    found: Preview
    dt: float | None
    rows: slice | None
    reading: ReadingOptions

    def inspect(self, inputs: tuple[str, ...], output: str | None) -> RecordInspection:
        output = output if output is None else find_column(output, self.table.names)
        read = self._read(inputs, output)
        values = {name: columns.numbers[name] for name, columns in read.items()}
        size = len(values[output]) if output in values else self._most_common_length(values)
        usable = {
            name: column
            for name, column in values.items()
            if len(column) == size and name != self.found.time and np.isfinite(column).any()
        }
        given = tuple(find_column(name, self.table.names) for name in inputs)
        choice = choose_columns(self._align(usable, read), given, output)
        if inputs and choice.inputs:
            choice = replace(choice, inputs=inputs)
        errors, excluded = self._find_gross_errors(read, choice)
        if self.reading.outliers != KEEP:
            values |= errors
        stamps, sampling = self._describe_sampling(read, size)
        warnings = [warning for warning in self.found.warnings if warning != sampling.problem]
        record, facts, remedy = None, RecordFacts(()), self.reading
        problem = self._describe_static(choice, usable)
        is_static = bool(problem)
        if is_static:
            sampling, warnings = replace(sampling, problem=""), []
        elif choice.output:
            repaired, problem = self._read_repaired(choice, self.reading)
            is_repaired = self.reading.gaps is not None or self.reading.resample is not None
            # A record with other samples than the rows has those of columns with different clocks.
            is_aligned = repaired is not None and not is_repaired and repaired.samples != size
            if repaired is not None and is_aligned:
                sampling = _describe_aligned(repaired, sampling)
                warnings = list(merge_notes(warnings, repaired.reading))
            if repaired is not None:
                # Options of reading have solved them.
                warnings = [each for each in warnings if each not in self.found.problems]
                sampling = replace(sampling, problem="")
            if is_repaired or is_aligned:
                record = repaired
            else:
                record = self._cut(values, choice, sampling.dt or 1.0, stamps)
            facts = measure_facts(record) if record is not None else facts
            if repaired is None and not is_repaired:
                remedy = self._find_remedy(choice, sampling.dt)
        command = "" if is_static else self._make_command(choice, remedy)
        unknown = _NO_SAMPLING_TIME if sampling.dt is None and facts.facts else ""
        breaks = () if stamps is None else stamps.breaks
        rows = {
            **excluded,
            problem: self._find_problem_rows(values, choice, breaks),
            sampling.problem: breaks,
        }
        texts = [sampling.problem, *warnings, problem, *excluded, unknown]
        first = next((columns.first for columns in read.values()), 0)
        return RecordInspection(
            str(self.path),
            self._describe_columns(values, choice),
            sampling,
            choice,
            facts,
            _make_notes(texts, {sampling.problem, problem, *self.found.problems}, rows, first),
            command,
            _find_changes(self.reading, remedy),
            record,
        )

    def _read(self, inputs: tuple[str, ...], output: str | None) -> Mapping[str, Columns]:
        """Return the columns that are chosen, or may be, over the chosen rows."""
        names = [column.name for column in self.found.columns if column.samples]
        chosen = {self.found.time, output, *(find_column(name, self.table.names) for name in inputs)}
        first = names[:_MOST_COLUMNS]
        read = {}
        for name in names:
            if name in chosen or (name in first and (output is None or not inputs)):
                read[name] = self.table.read((name,), self.rows)
        return read

    def _describe_static(self, choice: ColumnChoice, usable: Mapping[str, NDArray[np.float64]]) -> str:
        """State that two columns are points of a curve; empty for a record of a time."""
        is_timed = self.found.time is not None or self.found.dt is not None or self.dt is not None
        names = [find_column(name, self.table.names) for name in (*choice.inputs, choice.output)]
        pair = names if choice.output else list(usable)
        if is_timed or len(pair) != 2 or not is_static_curve(*(usable[name] for name in pair)):
            return ""
        return describe_static_curve(self.path.name, *pair)

    def _find_gross_errors(
        self, read: Mapping[str, Columns], choice: ColumnChoice
    ) -> tuple[Mapping[str, NDArray[np.float64]], Mapping[str, Sequence[int]]]:
        """Return the chosen columns without their gross errors, and warnings about them with the samples."""
        if not choice.output:
            return {}, {}
        names = [find_column(name, self.table.names) for name in choice.inputs]
        columns = replace(
            read[choice.output], numbers={name: read[name].numbers[name] for name in (*names, choice.output)}
        )
        try:
            found, excluded = exclude_gross_errors(
                columns, names, choice.output, replace(self.reading, outliers=EXCLUDE)
            )
        except RecordError:
            return {}, {}  # the reading of the record reports it
        treatment = join_text(" are left out (", name_option("outliers", KEEP), " uses them)")
        if self.reading.outliers == KEEP:
            treatment = join_text(" are used (", name_option("outliers", EXCLUDE), " leaves them out)")
        samples = {
            name: np.flatnonzero(np.isnan(found.numbers[name]) & ~np.isnan(columns.numbers[name])).tolist()
            for name in columns.numbers
        }
        return found.numbers, {
            join_text(errors, treatment): next(
                (rows for name, rows in samples.items() if errors.startswith(f"gross errors of {name}: ")), []
            )
            for errors in excluded
        }

    def _find_problem_rows(
        self, values: Mapping[str, NDArray[np.float64]], choice: ColumnChoice, breaks: Sequence[int]
    ) -> Sequence[int]:
        """Return the samples for which the chosen record is refused, in the order of its checks."""
        names = [find_column(name, self.table.names) for name in choice.inputs]
        if self.reading.outliers != KEEP:
            for name in names:
                for samples in find_input_codes(values[name]).values():
                    return [int(sample) for sample in samples]
        missing = np.zeros(0, dtype=np.int64)
        if names:
            missing = np.flatnonzero(
                ~np.isfinite(np.column_stack([values[name] for name in names])).all(axis=1)
            )
        return missing.tolist() if missing.size else breaks

    def _align(
        self, usable: Mapping[str, NDArray[np.float64]], read: Mapping[str, Columns]
    ) -> Mapping[str, NDArray[np.float64]]:
        """Return columns with samples in different rows at the times of the slowest one."""
        if self.reading.rates == ROWS or not usable:
            return usable
        names, values = tuple(usable), np.column_stack(list(usable.values()))
        if not may_differ(values, ()):
            return usable
        time, rows = self.found.time, read[names[0]].rows
        stamps = np.arange(len(values), dtype=np.float64)
        if time is not None and time in read and len(read[time].rows) == len(values):
            stamps = self._scale(read[time], time).stamps
        clocks = find_clocks(stamps, values, ())
        if not clocks:
            return usable
        recording = Recording(rows, stamps, values, str(time), 1.0)
        aligned = align_columns(recording, clocks, ColumnUse(names, (), SAMPLE), []).values
        return dict(zip(names, aligned.T, strict=True)) if len(aligned) >= _LEAST_ALIGNED else usable

    @staticmethod
    def _most_common_length(values: Mapping[str, NDArray[np.float64]]) -> int:
        lengths = [len(column) for column in values.values()]
        return max(set(lengths), key=lambda length: (lengths.count(length) > 1, length), default=0)

    def _describe_sampling(
        self, read: Mapping[str, Columns], size: int
    ) -> tuple[TimeStamps | None, InspectedSampling]:
        time, stamps = self.found.time, None
        dt = self.found.dt if self.dt is None else self.dt
        problem = _find_sampling_problem(self.found, dt)
        if time is not None and time in read and len(read[time].rows) == size:
            scale = self._scale(read[time], time)
            seconds = scale.stamps * scale.seconds
            stamps = describe_stamps(seconds) if np.isfinite(seconds).all() else None
        if stamps is None:
            return None, InspectedSampling(time, size, dt, None, (), (), (), NO_BREAKS, problem)
        rows = read[str(time)].rows
        gaps, repeated, backward = (
            tuple(rows.row(sample) for sample in samples[:MOST_ROWS])
            for samples in (stamps.gaps, stamps.repeated, stamps.backward)
        )
        dt = stamps.dt if dt is None else dt
        return stamps, InspectedSampling(
            time, size, dt, stamps.jitter, gaps, repeated, backward, stamps.counts, problem
        )

    def _scale(self, columns: Columns, time: str) -> TimeScale:
        structure = split_structures(self.table.names)[time]
        return find_time_scale(TimeSource(self.table, time, None, structure, self.reading), columns)

    def _field(self, name: str) -> str:
        return name.removeprefix(split_structures(self.table.names)[name])

    def _cut(
        self,
        values: Mapping[str, NDArray[np.float64]],
        choice: ColumnChoice,
        dt: float,
        stamps: TimeStamps | None,
    ) -> Dataset | None:
        """Return the record with segments between gaps and missing inputs; None if no part is long enough."""
        names = [find_column(name, self.table.names) for name in choice.inputs]
        u = np.column_stack([values[name] for name in names])
        y = np.where(np.isinf(values[choice.output]), np.nan, values[choice.output])
        whole = np.asarray(np.isfinite(u).all(axis=1))
        starts = np.zeros(len(y), dtype=bool)
        starts[list(stamps.breaks) if stamps is not None else []] = True
        starts[np.flatnonzero(np.diff(whole)) + 1] = True
        part = np.cumsum(starts)
        lengths = np.bincount(part)
        kept = whole & (lengths[part] >= _LEAST_PART)
        if np.count_nonzero(kept & np.isfinite(y)) < MIN_SAMPLES:
            return None
        return Dataset(
            u[kept],
            y[kept],
            dt,
            tuple(names),
            choice.output,
            tuple(parse_unit(self._field(name)) for name in names),
            parse_unit(self._field(choice.output)),
            segments=tuple(int(length) for length in np.unique(part[kept], return_counts=True)[1]),
        )

    def _read_repaired(self, choice: ColumnChoice, reading: ReadingOptions) -> tuple[Dataset | None, str]:
        """Return the record as it is read for a search, or the message with which it is refused."""
        file = self.path.name
        try:
            record = read_table(
                *(self.table, file, choice.inputs, choice.output, self.dt, self.rows), options=reading
            )
        except RecordError as error:
            return None, error.message
        return record, ""

    def _find_remedy(self, choice: ColumnChoice, dt: float | None) -> ReadingOptions:
        """Return the first options with which the record can be read; those that are given if none helps."""
        step = None if dt is None else float(f"{dt:.6g}")
        remedies: list[dict[str, Any]] = [
            {"gaps": "split"},
            {"resample": step},
            {"gaps": "split", "resample": step},
        ]
        for changes in remedies if step is not None else remedies[:1]:
            reading = replace(self.reading, **changes)
            if self._read_repaired(choice, reading)[0] is not None:
                return reading
        return self.reading

    def _describe_columns(
        self, values: Mapping[str, NDArray[np.float64]], choice: ColumnChoice
    ) -> tuple[InspectedColumn, ...]:
        inputs = {find_column(name, self.table.names) for name in choice.inputs}
        roles: dict[str | None, str] = {
            self.table.clocks.get(self.found.time or ""): "date",
            self.found.time: "time",
            choice.output: "output",
            **dict.fromkeys(inputs, "input"),
        }
        return tuple(
            self._describe_column(column, values, roles.get(column.name, "")) for column in self.found.columns
        )

    @staticmethod
    def _describe_column(
        column: ColumnPreview, values: Mapping[str, NDArray[np.float64]], role: str
    ) -> InspectedColumn:
        if column.name not in values:
            return InspectedColumn(column.name, column.unit, role, None, None, 0, column.problem)
        return describe_values(column.name, column.unit, role, values[column.name], column.problem)

    def _make_command(self, choice: ColumnChoice, reading: ReadingOptions) -> str:
        if not choice.output:
            return ""
        words = ["islands", "identify", str(self.path)]
        for name in choice.inputs:
            words += ["--input", _quote_commas(name)]
        words += ["--output", _quote_commas(choice.output)]
        if self.found.dt is None and self.found.time is None:
            words += ["--dt", "SECONDS" if self.dt is None else f"{self.dt:g}"]
        if self.rows is not None:
            bounds = ("" if bound is None else str(bound) for bound in (self.rows.start, self.rows.stop))
            words += ["--rows", ":".join(bounds)]
        for name, value in reading.changes().items():
            words += ["--set", write_setting(name, value)]
        return shlex.join([*words, "--out", "result"])


def _make_notes(
    texts: Sequence[str], problems: Collection[str], rows: Mapping[str, Sequence[int]], first: int
) -> tuple[RecordNote, ...]:
    """Return notes of different texts; ``rows`` are the samples that they concern, counted from ``first``."""
    return tuple(
        make_note(text, text in problems, [first + row for row in rows.get(text, ())])
        for text in dict.fromkeys(filter(None, texts))
    )


def _find_changes(reading: ReadingOptions, remedy: ReadingOptions) -> dict[str, Any]:
    return {name: value for name, value in remedy.changes().items() if value != getattr(reading, name)}


def _quote_commas(name: str) -> str:
    """Return a name as a value of the command line, where a comma without a blank separates names."""
    return f'"{name}"' if re.search(r",(?!\s)", name) else name


def _describe_aligned(record: Dataset, sampling: InspectedSampling) -> InspectedSampling:
    """Return the sampling of a record whose columns had different clocks: the rows are not its samples."""
    return InspectedSampling(sampling.time, record.samples, record.dt, None, (), (), (), NO_BREAKS, "")


def _find_sampling_problem(found: Preview, dt: float | None) -> str:
    """Return the warning of a preview about its sampling."""
    if found.dt is not None or (dt is not None and found.time is None):
        return ""
    words = ("time", name_option("dt"), "grid", "gap")
    return next((text for text in found.warnings if any(word in text for word in words)), "")
