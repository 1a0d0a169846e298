"""Choice of one equation per output by the error of their common free run."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, sqrt

from islands.models.coupled_narx import CoupledModel
from islands.models.narx import Model
from islands.records.coupled import CoupledRecord
from islands.rounding import RESOLUTION
from islands.simulation.predictors import free_run

#: Excess of the error over the least, as a fraction, that never justifies another term.
NEGLIGIBLE_EXCESS = 0.03

#: Passes over the outputs. Most searches end after two.
_PASSES = 5


@dataclass(frozen=True, slots=True)
class CoupledChoice:
    """Chosen rank of every output, and the error of the coupled free run on the validation data.

    ``error`` is the root mean square over the outputs of the RMSE relative to the range; infinite if the free
    run of every tried combination diverges.
    """

    ranks: tuple[int, ...]
    error: float


def choose_equations(
    ranked: Sequence[Sequence[Model]],
    recommended: Sequence[int],
    validation: CoupledRecord,
    warm_up: int,
    skip: Callable[[], bool] = lambda: False,
) -> CoupledChoice:
    """Choose one of the ranked models of every output.

    One output after the other takes the model with the least error of the coupled free run, or a smaller one
    that is at most 3 % worse, until no choice changes. The searches start from the recommended models, from
    those with the least validation error and from the smallest ones.

    Parameters
    ----------
    ranked : sequence of sequence of Model
        Models of every output, best first.
    recommended : sequence of int
        Recommended rank of every output, from 1.
    validation : CoupledRecord
        Validation data with the sampling time of the models.
    warm_up : int
        Number of samples before the first prediction.
    skip : callable
        Called before each comparison. Once it returns true, the choice is the best one so far.
    """
    errors: dict[tuple[int, ...], float] = {}

    def measure(places: tuple[int, ...]) -> float:
        if places not in errors:
            chosen = [models[place] for models, place in zip(ranked, places, strict=True)]
            errors[places] = measure_error(CoupledModel(tuple(chosen)), validation, warm_up)
        return errors[places]

    def count_terms(places: tuple[int, ...]) -> int:
        return sum(models[place].size for models, place in zip(ranked, places, strict=True))

    def prefer(candidates: Sequence[tuple[int, ...]]) -> tuple[int, ...]:
        least = min(map(measure, candidates))
        limit = max(RESOLUTION, (1.0 + NEGLIGIBLE_EXCESS) * least)
        equal = [each for each in candidates if measure(each) <= limit]
        return min(equal, key=lambda each: (count_terms(each), measure(each), each))

    def descend(places: tuple[int, ...]) -> tuple[int, ...]:
        for _ in range(_PASSES):
            before = places
            for output, models in enumerate(ranked):
                if skip():
                    return places
                places = prefer(
                    [(*places[:output], place, *places[output + 1 :]) for place in range(len(models))]
                )
            if places == before:
                break
        return places

    best = prefer([descend(start) for start in _list_starts(ranked, recommended)])
    return CoupledChoice(tuple(place + 1 for place in best), measure(best))


def _list_starts(ranked: Sequence[Sequence[Model]], recommended: Sequence[int]) -> Iterator[tuple[int, ...]]:
    yield tuple(rank - 1 for rank in recommended)
    yield (0,) * len(ranked)
    yield tuple(min(range(len(models)), key=lambda place: models[place].size) for models in ranked)


def measure_error(model: CoupledModel, validation: CoupledRecord, warm_up: int) -> float:
    """Return the error of the coupled free run relative to the ranges of the outputs."""
    simulated = free_run(model, validation, warm_up)
    if not simulated.outcome:
        return inf
    ranges = [each.output_range or 1.0 for each in validation.records]
    # The square of a very small range would be 0.
    relative = [
        error / scale / scale for error, scale in zip(simulated.mean_squared_errors, ranges, strict=True)
    ]
    return sqrt(sum(relative) / len(relative))
