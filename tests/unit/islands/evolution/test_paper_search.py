"""The search of the paper repeats bit for bit and selects by the free run."""

import pytest

from islands.errors import RecordError
from islands.evolution.evaluation import Evaluator
from islands.evolution.paper_search import estimate_again, list_models, rank_models, run_island
from islands.evolution.presets import resolve_settings
from islands.records.dataset import Dataset
from islands.systems.bouc_wen import authors_estimation
from islands.systems.published_models import PUBLISHED


def test_a_search_reports_each_generation_and_repeats_bit_for_bit() -> None:
    record = authors_estimation()[:1500]
    settings = resolve_settings("paper-case1", {"population": 20, "generations": 2})
    seen: list[int] = []
    found = [
        list_models(
            run_island(Evaluator(record, settings), 3, lambda island, _: seen.append(island.generation)),
            record,
        )
        for _ in range(2)
    ]
    assert seen == [0, 1, 2, 0, 1, 2]
    assert found[0] == found[1]
    assert {model.input_names for model in found[0]} == {record.input_names}


def test_models_are_ranked_by_their_free_run_without_those_that_diverge() -> None:
    record = authors_estimation()[:1500]
    best = estimate_again(PUBLISHED["13"], authors_estimation())
    worse = best.with_parameters([best.parameters[0], *(1.2 * value for value in best.parameters[1:])])
    unstable = best.with_parameters([1.5, *best.parameters[1:]])
    assert rank_models([unstable, worse, best], record) == [best, worse]


def test_structure_that_the_record_does_not_excite_is_refused() -> None:
    still = Dataset([0.0] * 50, [float(k % 2) for k in range(50)], 1e-3, ("u_V",), "y_um")
    with pytest.raises(RecordError, match="cannot be estimated"):
        estimate_again(PUBLISHED["13"], still)
