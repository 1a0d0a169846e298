"""Dead times of a candidate library: lags of inputs that start after a number of samples."""

from collections.abc import Iterable, Sequence

from islands.errors import SettingsError, check_integers, check_sequences
from islands.expressions.tree import Apply, Expression, Lagged
from islands.models.narx import canonical_order
from islands.models.regressor import Regressor, regressor

#: Largest dead time in samples. Every lag of an input costs a sample at the start of each recording.
LARGEST_DELAY = 1000


def check_delays(delays: Sequence[int]) -> None:
    """Check that no dead time is negative or too large.

    Raises
    ------
    SettingsError
        A dead time is out of range, or no integer.
    """
    check_sequences(delays=delays)
    for delay in delays:
        check_integers(delays=delay)
    if any(not 0 <= delay <= LARGEST_DELAY for delay in delays):
        raise SettingsError(f"dead times lie between 0 and {LARGEST_DELAY} samples, got {list(delays)}")


def expand_delays(delays: Sequence[int], inputs: int) -> tuple[int, ...]:
    """Return one dead time for each input: none are 0, and one applies to all inputs.

    Raises
    ------
    SettingsError
        There are several dead times, and not one for each input.
    """
    if len(delays) not in (0, 1, inputs):
        raise SettingsError(f"give one dead time, or one for each of the {inputs} inputs, got {list(delays)}")
    return tuple(delays) if len(delays) == inputs else (sum(delays),) * inputs


def delay_inputs(regressors: Iterable[Regressor], delays: Sequence[int]) -> tuple[Regressor, ...]:
    """Return regressors in canonical order whose inputs are read later by the dead times, in samples."""
    if not any(delays):
        return tuple(regressors)
    delayed = (regressor(_delay(item.expression, delays))[1] for item in regressors)
    return tuple(canonical_order(item for item in delayed if item))


def _delay(expression: Expression, delays: Sequence[int]) -> Expression:
    match expression:
        case Lagged(channel, lag) if channel:
            return Lagged(channel, lag + delays[channel - 1])
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_delay(argument, delays) for argument in arguments))
    return expression
