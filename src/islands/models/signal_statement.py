"""Statement of the signals that an equation reads: deviations, filtered or decimated samples, means."""

from collections.abc import Sequence

from islands.records.channel_names import parse_channel_name
from islands.records.signal_map import SampledReference, SignalReference


def describe_signals(model: SignalReference, names: Sequence[str] = ()) -> str:
    """State which signals the equation of a model reads.

    Parameters
    ----------
    model : DynamicModel
    names : sequence of str
        Names of the output and of every input in the text of the equation; by default y and u, or y, u1, u2.

    Returns
    -------
    str
        ``y is the deviation from 3.2 cm, u from 4 V; k counts steps of 0.04 s: each value is ...``. Empty if
        the signals are those of the record.
    """
    done = model.preprocessing
    offsets = () if done is None else (done.output_offset, *done.input_offsets)
    columns = (model.output_name, *(parse_channel_name(name).base for name in model.input_names))
    return join_statements(model, names or symbols(len(model.input_names)), columns, offsets)


def symbols(inputs: int) -> tuple[str, ...]:
    """Return the symbols of the output and of the inputs: y and u, or y, u1, u2 .. for several inputs."""
    return ("y", "u") if inputs == 1 else ("y", *(f"u{place + 1}" for place in range(inputs)))


def join_statements(
    model: SampledReference, names: Sequence[str], columns: Sequence[str], offsets: Sequence[float]
) -> str:
    """State the offsets of signals, none for signals as measured, and the rate of a model.

    Parameters
    ----------
    names, columns : sequence of str
        Names of the signals in the equation, and in the record, which have the units.
    """
    moved = [
        f"{name} from {offset:.8g} {parse_channel_name(column).unit}".rstrip()
        for name, column, offset in zip(names, columns, offsets, strict=False)
        if offset
    ]
    deviations = ", ".join(moved).replace(" from ", " is the deviation from ", 1)
    values = describe_values(model)
    steps = "k counts steps" if model.dt is None else f"k counts steps of {model.dt:g} s"
    return "; ".join(filter(None, [deviations, values and f"{steps}: {values}"]))


def describe_values(model: SampledReference) -> str:
    """State what a value of a signal is: a filtered or decimated sample, or a mean; empty for a sample."""
    done, sample = model.preprocessing, ""
    if done is not None and done.has_rate_steps:
        cutoffs = [f"{cutoff:.4g} Hz" for cutoff in (done.steps.lowpass, done.decimation_cutoff) if cutoff]
        filters = "a zero-phase low-pass filter" if len(cutoffs) == 1 else "zero-phase low-pass filters"
        count = "a sample" if done.steps.decimate == 1 else f"one of {done.steps.decimate} samples"
        sample = f"{count} of {done.dt:g} s behind {filters} of {' and '.join(cutoffs)}"
    if model.average == 1:
        return sample and f"each value is {sample}"
    mean = f"each value is the mean of {model.average}"
    return f"{mean} values, each {sample}" if sample else f"{mean} samples of the record"
