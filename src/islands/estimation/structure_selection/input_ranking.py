"""Candidate libraries for records with many inputs: products only of the inputs that matter.

The number of products grows with a power of the number of inputs (equation (5)). If the library of all inputs
is too large, the inputs are ranked by a forward selection over the library of the largest degree that is not
too large, which for about twenty inputs contains the products of pairs. The selection uses a part of a long
record and ends when the gain of a candidate is that of chance. The library then has its full degree in the
inputs of the ranking, as many as its size allows, and degree 1 in the others.
"""

from collections.abc import Sequence
from math import log

from islands.errors import SettingsError
from islands.estimation.forward_selection import forward_selection
from islands.estimation.structure_selection.input_delays import delay_inputs, expand_delays
from islands.expressions.tree import Apply, Expression, Lagged
from islands.models.candidate_library import candidates, count_inputs, largest_degree
from islands.models.narx import canonical_order
from islands.models.regressor import Regressor, regressor
from islands.records.dataset import Dataset, join
from islands.simulation.outcome import EvaluationOutcome

#: Terms of the forward selection that ranks the inputs.
_TERMS = 20

#: Rows of that selection, at most, and the number of blocks of the record that contain them.
_ROWS, _BLOCKS = 4000, 8


def screen_candidates(
    name: str,
    degree: int,
    lags: int,
    record: Dataset,
    constraints: str = "none",
    delays: Sequence[int] = (),
) -> tuple[Regressor, ...]:
    """Return the regressors of a library for a record, in canonical order.

    Equal to `candidates` if the library of all inputs is not too large and there is no dead time.

    Parameters
    ----------
    name : str
        An entry of ``LIBRARIES``.
    degree, lags : int
        Degree and maximum lag of the library.
    record : Dataset
        Record that ranks the inputs.
    constraints : str
        Name of an entry of ``CONSTRAINTS``, under which the inputs are ranked.
    delays : sequence of int
        Dead times in samples: none, one, or one for each input.

    Raises
    ------
    SettingsError
        As in `candidates`, for the library of one input, or as in `expand_delays`.
    """
    later = expand_delays(delays, record.inputs)
    count = count_inputs(name, degree, lags, record.inputs)
    if count == record.inputs:
        return delay_inputs(candidates(name, degree, lags, record.inputs), later)
    kept = sorted(rank_inputs(name, degree, lags, record, constraints, later)[:count]) or [1]
    full = (_move_inputs(item.expression, kept) for item in candidates(name, degree, lags, len(kept)))
    linear = candidates(name, 1, lags, record.inputs)
    pool = canonical_order([*linear, *(item for each in full if (item := regressor(each)[1]))])
    return delay_inputs(pool, later)


def rank_inputs(
    name: str,
    degree: int,
    lags: int,
    record: Dataset,
    constraints: str = "none",
    delays: Sequence[int] = (),
) -> tuple[int, ...]:
    """Return the numbers of the inputs, from 1, in the order in which forward selection chooses them.

    Inputs that it does not choose are left out. Arguments and errors are those of `screen_candidates`.
    """
    later = expand_delays(delays, record.inputs)
    largest = largest_degree(name, degree, lags, record.inputs)
    library = delay_inputs(candidates(name, largest, lags, record.inputs), later)
    part = _take_blocks(record, lags + max(later))
    # Risk inflation criterion: the largest gain of irrelevant candidates (Foster and George 1994).
    chance = 2.0 * log(len(library)) / part.samples
    found = forward_selection(library, part, constraints, _TERMS, chance)
    if isinstance(found, EvaluationOutcome):
        raise SettingsError(f"the inputs cannot be ranked with these settings: {found}")
    chosen = [channel for structure in found for item in structure for channel, _ in sorted(item.lags)]
    return tuple(channel for channel in dict.fromkeys(chosen) if channel)


def _take_blocks(record: Dataset, lags: int) -> Dataset:
    """Return equal blocks of the record at equal distances, `_ROWS` rows in all; a shorter record itself."""
    length = _ROWS // _BLOCKS + lags
    if record.samples <= _BLOCKS * length:
        return record
    starts = [block * (record.samples - length) // (_BLOCKS - 1) for block in range(_BLOCKS)]
    return join(tuple(record[start : start + length] for start in starts))


def _move_inputs(expression: Expression, channels: Sequence[int]) -> Expression:
    """Replace input 1 by the first of some channels, input 2 by the second, and so on."""
    match expression:
        case Lagged(channel, lag) if channel:
            return Lagged(channels[channel - 1], lag)
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_move_inputs(argument, channels) for argument in arguments))
    return expression
