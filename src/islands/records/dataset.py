"""Record of inputs and one output on a common uniform time grid, in one or several recordings."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError, check_seconds, check_sequences, check_type
from islands.records.channel_names import describe_contradiction
from islands.records.masked_values import fill_masked
from islands.records.preprocessing_steps import Preprocessing

#: Largest relative difference between equal sampling times. A printed time column is not more precise.
SAME_DT = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Dataset:
    """Several inputs and one output of one system, sampled at ``dt``.

    Attributes
    ----------
    u : ndarray, shape (samples, inputs)
        The inputs, finite.
    y : ndarray, shape (samples,)
        The output, never infinite. NaN marks a missing value. A free run reads the output only during its
        warm-up, so the rest may be missing. Estimation requires a complete output.
    dt : float
        Sampling time in seconds.
    input_names, output_name
        Column names, such as ``u_V``.
    input_units, output_unit
        Units. Empty if unknown.
    segments : tuple of int
        Lengths of the consecutive segments in samples; they sum to ``samples``. No regressor reaches across
        a boundary.
    recordings : tuple of str
        Name of the recording of every segment, or one name for all of them; empty if it has none. A recording
        that was cut at a gap has several consecutive segments.
    start : float
        Time of the first sample in seconds.
    sha256 : str
        Hexadecimal hash of the source file. Empty if unknown.
    reading : tuple of str
        What was done to the samples of the file, such as resampling, in this order.
    preprocessing : Preprocessing or None
        Steps that were done with the samples, see `islands.records.preprocessing.preprocess`.
    held_out : int
        Number of samples at the end, in whole segments, that a diagnosis holds out; 0 for a quarter of the
        samples.
    measured : ndarray, shape (samples,), or None
        The output with the gross errors that ``y`` leaves out, after the same steps; None if there are none.

    Raises
    ------
    RecordError
        Shapes, names, units, segments or ``dt`` are inconsistent, there is no sample, a value is infinite, or
        an input is missing.
    """

    u: NDArray[np.float64]
    y: NDArray[np.float64]
    dt: float
    input_names: tuple[str, ...] = ("u",)
    output_name: str = "y"
    input_units: tuple[str, ...] = ("",)
    output_unit: str = ""
    segments: tuple[int, ...] = ()
    recordings: tuple[str, ...] = ()
    start: float = 0.0
    sha256: str = ""
    reading: tuple[str, ...] = ()
    preprocessing: Preprocessing | None = None
    held_out: int = 0
    measured: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        u, y = _to_numbers(self.u, "inputs"), _to_numbers(self.y, "output")
        if u.ndim == 1:
            u = u[:, None]
        if u.ndim != 2 or y.ndim != 1 or len(u) != len(y):
            raise RecordError(
                "inputs are a (samples, inputs) array, the output a (samples,) array of the same length; "
                f"got {np.shape(self.u)} and {np.shape(self.y)}"
            )
        inputs = u.shape[1]
        names = (
            self.input_names if len(self.input_names) == inputs else _number_names(self.input_names, inputs)
        )
        units = ("",) * inputs if tuple(self.input_units) == ("",) else tuple(self.input_units)
        if len(units) != inputs:
            raise RecordError(f"{inputs} inputs need {inputs} units, got {units}")
        for name, unit in zip((*names, self.output_name), (*units, self.output_unit), strict=True):
            if contradiction := describe_contradiction(name, unit):
                raise RecordError(contradiction)
        if not y.size:
            raise RecordError("the record has 0 samples: give at least one")
        check_sequences(segments=self.segments)
        segments = tuple(int(length) for length in self.segments) or (len(y),)
        check_seconds(self.dt, "the sampling time dt", RecordError)
        _check_segments(segments, len(y), self.held_out)
        recordings = tuple(self.recordings) or ("",)
        recordings *= len(segments) if len(recordings) == 1 else 1
        if len(recordings) != len(segments):
            raise RecordError(f"{len(segments)} segments need {len(segments)} names, got {recordings}")
        _check_finite(u, y, names, self.output_name)
        measured = None if self.measured is None else _to_numbers(self.measured, "measured output")
        if measured is not None and measured.shape != y.shape:
            raise RecordError(f"the measured output has {measured.size} samples, the output {y.size}")
        for array in (u, y, measured):
            if array is not None:
                array.setflags(write=False)
        for field, value in (
            ("u", u),
            ("y", y),
            ("measured", measured),
            ("input_names", tuple(names)),
            ("input_units", units),
            ("segments", segments),
            ("recordings", recordings),
        ):
            object.__setattr__(self, field, value)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.y)

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return int(self.u.shape[1])

    @property
    def records(self) -> tuple["Dataset"]:
        """The record of every output, as of several."""
        return (self,)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return (self.output_name,)

    def map(self, function: "Callable[[Dataset], Dataset]") -> "Dataset":
        """Return the record with a function applied to the record of every output."""
        return function(self)

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of every sample in seconds, shape (samples,). Recordings follow each other without a pause."""
        return self.start + self.dt * np.arange(self.samples, dtype=np.float64)

    @property
    def bounds(self) -> tuple[tuple[int, int], ...]:
        """First sample of every segment and the sample after its last."""
        ends = np.cumsum(self.segments)
        return tuple((int(end) - length, int(end)) for end, length in zip(ends, self.segments, strict=True))

    @property
    def rows_by_recording(self) -> dict[str, slice]:
        """Samples of every recording, by its name."""
        rows: dict[str, slice] = {}
        for name, (begin, end) in zip(self.recordings, self.bounds, strict=True):
            rows[name] = slice(rows[name].start if name in rows else begin, end)
        return rows

    @property
    def longest_segment(self) -> "Dataset":
        """The longest segment as a separate record; the first of several."""
        if len(self.segments) == 1:
            return self
        begin, end = max(self.bounds, key=lambda bounds: bounds[1] - bounds[0])
        return self[begin:end]

    @property
    def output_range(self) -> float:
        """``max(y) - min(y)`` of the known samples (NaN if there is none); scale of MAPE, equation (7)."""
        present = self.y[~np.isnan(self.y)]
        return float(np.ptp(present)) if present.size else float("nan")

    def __repr__(self) -> str:
        names = ", ".join(self.input_names)
        return f"<Dataset of {self.samples} samples of {self.dt:g} s: {names} to {self.output_name}>"

    def __len__(self) -> int:
        return self.samples

    def change_outputs(
        self, function: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    ) -> dict[str, Any]:
        """Return the output, and the measured one, after a function, as arguments of ``replace``."""
        return {
            "y": function(self.y),
            "measured": None if self.measured is None else function(self.measured),
        }

    def first_inputs(self, count: int) -> "Dataset":
        """Return the record with only its first ``count`` inputs."""
        return replace(
            self,
            u=self.u[:, :count],
            input_names=self.input_names[:count],
            input_units=self.input_units[:count],
            preprocessing=self.preprocessing and self.preprocessing.select_inputs(range(count)),
        )

    def __getitem__(self, rows: slice) -> "Dataset":
        """Return the samples of a slice (step 1) as a separate record; segments are cut but not joined."""
        check_type(rows, slice, "a record", "write record[start:stop]; record.u and record.y are the arrays")
        first, last, step = rows.indices(self.samples)
        if step != 1 or last <= first:
            raise RecordError(f"take a non-empty slice of step 1 of the record's {self.samples} samples")
        kept = [
            (min(last, end) - max(first, begin), name)
            for (begin, end), name in zip(self.bounds, self.recordings, strict=True)
            if min(last, end) > max(first, begin)
        ]
        fitted = self.samples - self.held_out
        return replace(
            self,
            u=self.u[first:last],
            **self.change_outputs(lambda y: y[first:last]),
            held_out=last - fitted if first < fitted < last else 0,
            segments=tuple(length for length, _ in kept),
            recordings=tuple(name for _, name in kept),
            start=self.start + first * self.dt,
        )


def _to_numbers(values: object, name: str) -> NDArray[np.float64]:
    try:
        return np.array(fill_masked(values), dtype=np.float64, order="C", ndmin=1)
    except (TypeError, ValueError) as error:
        raise RecordError(f"the {name} are not an array of numbers: {error}") from error


def _check_finite(
    u: NDArray[np.float64], y: NDArray[np.float64], names: tuple[str, ...], output: str
) -> None:
    if not np.isfinite(u).all():
        sample, channel = np.argwhere(~np.isfinite(u))[0]
        raise RecordError(
            f"input {names[channel]} is not finite at sample {sample}: repair or cut the record"
        )
    if np.isinf(y).any():
        raise RecordError(
            f"output {output} is infinite at sample {np.argmax(np.isinf(y))}: repair or cut the record; NaN "
            "marks a missing value"
        )


def _check_segments(segments: tuple[int, ...], samples: int, held_out: int) -> None:
    if sum(segments) != samples or min(segments) < 1:
        raise RecordError(
            f"the segments' lengths {segments} must be positive and sum to the {samples} samples"
        )
    if held_out and samples - held_out not in np.cumsum(segments)[:-1]:
        raise RecordError(f"segments of {segments} samples cannot be divided so that {held_out} are held out")


def _number_names(names: tuple[str, ...], inputs: int) -> tuple[str, ...]:
    if names == ("u",):
        return tuple(f"u{index + 1}" for index in range(inputs))
    raise RecordError(f"{inputs} inputs need {inputs} names, got {names}")


def same_dt(one: float, other: float) -> bool:
    """Return whether two sampling times are equal within `SAME_DT`."""
    return abs(one - other) <= SAME_DT * min(one, other)


def join(recordings: tuple[Dataset, ...]) -> Dataset:
    """Join several recordings of one system; no regressor reaches from one into another.

    Recordings without a name get the number of their place as a name. If a name occurs before, the number is
    added to it. A single recording is returned itself.

    Raises
    ------
    RecordError
        There is no recording, or the recordings differ in names, units or sampling time.
    SettingsError
        A recording is not a Dataset.
    """
    if isinstance(recordings, Dataset):
        raise SettingsError("join takes a sequence of Datasets, got one: write join((one, other))")
    if not recordings:
        raise RecordError("there is no recording to join: give at least one")
    for each in recordings:
        if not isinstance(each, Dataset):
            raise SettingsError(
                f"join takes Datasets, got a {type(each).__name__}: make each by as_record(data, inputs=..., "
                "output=...), or give the list of data frames in place of one"
            )
    first = recordings[0]
    if len(recordings) == 1:
        return first
    for other in recordings[1:]:
        same = (other.input_names, other.output_name, other.input_units, other.output_unit)
        if same != (first.input_names, first.output_name, first.input_units, first.output_unit):
            raise RecordError(
                "recordings of one system must have the same columns and units: rename or convert them first"
            )
        if not same_dt(first.dt, other.dt):
            raise RecordError(
                f"recordings were sampled at {first.dt:.10g} s and {other.dt:.10g} s: resample one of them"
            )
    names = _name_recordings(recordings)
    return replace(
        first,
        u=np.concatenate([recording.u for recording in recordings]),
        y=np.concatenate([recording.y for recording in recordings]),
        segments=tuple(length for recording in recordings for length in recording.segments),
        recordings=names,
        sha256="",
        held_out=0,
        reading=_join_reading(recordings, names),
        measured=None
        if all(each.measured is None for each in recordings)
        else np.concatenate([each.y if each.measured is None else each.measured for each in recordings]),
    )


def _join_reading(recordings: tuple[Dataset, ...], names: tuple[str, ...]) -> tuple[str, ...]:
    """Return what was done to the samples, with the names of the recordings if it was not done to all."""
    ends = np.cumsum([len(recording.recordings) for recording in recordings])
    found: dict[str, list[str]] = {}
    for recording, end in zip(recordings, ends.tolist(), strict=True):
        own = dict.fromkeys(names[end - len(recording.recordings) : end])
        for step in dict.fromkeys(recording.reading):
            # A recording that was joined before has a step of one of its parts with the name of that part.
            is_named = any(step.startswith(f"{name}: ") for name in own)
            found.setdefault(step, []).extend(() if is_named else own)
    return tuple(
        step if not labels or len(labels) == len(set(names)) else f"{', '.join(labels)}: {step}"
        for step, labels in found.items()
    )


def _name_recordings(recordings: tuple[Dataset, ...]) -> tuple[str, ...]:
    """Return a name for every segment; recordings that are joined have different names."""
    names: list[str] = []
    for number, recording in enumerate(recordings, start=1):
        known = set(names)
        for name in recording.recordings:
            numbered = f"{name} ({number})" if name else str(number)
            names.append(numbered if not name or name in known else name)
    return tuple(names)
