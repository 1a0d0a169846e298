"""Preprocessing of a record as a value: what was done, and with which offsets."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from islands.settings_schema import Integer, setting, settings_class

#: Values of ``detrend``.
DETREND = ("none", "constant", "linear")

#: Cutoff before a decimation, relative to half of the new sampling rate.
_CUTOFF = 0.8


@settings_class
class PreprocessingSteps:
    """Steps before a search, in the order in which they are done."""

    lowpass: float | None = setting(
        None, "Cutoff of a zero-phase low-pass filter of inputs and output.", gt=0, unit="Hz"
    )
    decimate: Integer = setting(
        1, "Keep one of this number of samples, behind a zero-phase low-pass filter.", ge=1
    )
    detrend: str = setting(
        "none",
        "Subtract the mean of every signal, or also a straight line from the output.",
        choices=DETREND,
    )

    @property
    def is_none(self) -> bool:
        """Whether there is no step."""
        return self == NO_STEPS

    @property
    def has_rate_steps(self) -> bool:
        """Whether the record is filtered or decimated."""
        return self.lowpass is not None or self.decimate > 1


#: No preprocessing.
NO_STEPS = PreprocessingSteps()


def find_decimation_cutoff(dt: float, decimate: int) -> float:
    """Return the cutoff in hertz of the filter before a decimation of samples of ``dt`` seconds."""
    return _CUTOFF * 0.5 / (dt * decimate)


@dataclass(frozen=True, slots=True)
class Preprocessing:
    """Steps that were done with a record, and the values with which another record repeats them.

    Attributes
    ----------
    steps : PreprocessingSteps
    dt : float
        Sampling time in seconds before the steps.
    input_offsets, output_offset : tuple of float, float
        Values that were subtracted. A model of the record reads and predicts deviations from them.
    output_slope : float
        Slope, per second, of the line that was subtracted from the output. It describes a drift of this
        record only, so it is neither subtracted from another one nor added to a simulation.
    """

    steps: PreprocessingSteps
    dt: float
    input_offsets: tuple[float, ...]
    output_offset: float
    output_slope: float

    @property
    def has_rate_steps(self) -> bool:
        """Whether the record was filtered or decimated."""
        return self.steps.has_rate_steps

    @property
    def decimation_cutoff(self) -> float | None:
        """Cutoff in hertz of the filter before the decimation. None without a decimation."""
        return None if self.steps.decimate == 1 else find_decimation_cutoff(self.dt, self.steps.decimate)

    @property
    def rate_steps(self) -> PreprocessingSteps:
        """The filter and the decimation."""
        return replace(self.steps, detrend="none")

    @property
    def without_offsets(self) -> "Preprocessing":
        """The filter and the decimation alone: signals as measured, at the rate of the model."""
        return Preprocessing(self.rate_steps, self.dt, (0.0,) * len(self.input_offsets), 0.0, 0.0)

    def relative_to(self, done: "Preprocessing") -> "Preprocessing":
        """Return the preprocessing with the offsets that remain after another one, of at least its inputs."""
        pairs = zip(self.input_offsets, done.input_offsets, strict=False)
        return replace(
            self,
            input_offsets=tuple(own - other for own, other in pairs),
            output_offset=self.output_offset - done.output_offset,
        )

    def select_inputs(self, places: Iterable[int]) -> "Preprocessing":
        """Return the preprocessing of some inputs, in another order."""
        return replace(self, input_offsets=tuple(self.input_offsets[place] for place in places))

    def with_inputs(self, offsets: Iterable[float]) -> "Preprocessing":
        """Return the preprocessing with further inputs, which have the given offsets."""
        return replace(self, input_offsets=(*self.input_offsets, *offsets))

    def as_document(self) -> dict[str, Any]:
        """Return the preprocessing as JSON values."""
        return asdict(self) | {"input_offsets": list(self.input_offsets)}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> "Preprocessing":
        """Return the preprocessing of a document.

        Raises
        ------
        KeyError, TypeError
            The document is damaged.
        """
        return cls(
            PreprocessingSteps(**document["steps"]),
            float(document["dt"]),
            tuple(float(offset) for offset in document["input_offsets"]),
            float(document["output_offset"]),
            float(document["output_slope"]),
        )
