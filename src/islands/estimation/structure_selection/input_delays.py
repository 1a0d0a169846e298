"""Dead times of a candidate library: lags of inputs that start after a number of samples."""

from collections.abc import Iterable, Sequence
from typing import Annotated

from pydantic import Field

from islands.errors import SettingsError
from islands.expressions.tree import Apply, Expression, Lagged
from islands.models.narx import canonical_order
from islands.models.regressor import Regressor, regressor
from islands.settings_schema import AS_INTEGER, AS_TUPLE

#: Largest dead time in samples. Every lag of an input costs a sample at the start of each recording.
LARGEST_DELAY = 1000


#: Dead times, in samples.
Delays = Annotated[tuple[Annotated[int, Field(ge=0, le=LARGEST_DELAY), AS_INTEGER], ...], AS_TUPLE]


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
