"""Recommended model: the smallest that is as good as the best, bounded, and with the claimed physics."""

import re
from dataclasses import dataclass
from math import nan, sqrt
from types import SimpleNamespace

import numpy as np
import pytest

from islands.simulation.outcome import OK, EvaluationOutcome, Status
from islands.validation.assessment import Assessment
from islands.validation.metrics import Metrics
from islands.validation.physics import ClusterSum, ExcursionTest, ExtremeTest, HoldTest, PhysicsChecks
from islands.validation.recommendation import (
    Exclusion,
    compare_blocks,
    recommend,
    recommend_fittest,
)

LOST = EvaluationOutcome(Status.DIVERGED, "at sample 3")

#: Squared errors of noise with an RMSE of 1 %, in 20 blocks.
NOISE = 1e-4 * (1.0 + 0.2 * np.random.default_rng(0).standard_normal(20))

#: Error on the estimation data that is 10 % less than that of a `Candidate` by default.
BETTER = 0.009


@dataclass(frozen=True)
class Candidate:
    size: int
    blocks: np.ndarray
    bounded: bool = True
    property_1: bool = True
    trained: float = nan
    ranges: float = 0.0
    drift: float = 0.0
    estimated: float = 0.01

    def assessment(self):
        physics = PhysicsChecks(
            (ClusterSum("y", 1.0 if self.property_1 else 0.5, 1.0),),
            True,
            (HoldTest(0.0, True, True, True, 0.0),),
            (ExcursionTest("rate x 5", self.bounded, 0.0, 100.0),),
            (
                ExtremeTest(1.0, True, self.ranges / 2.0, 0.0),
                ExtremeTest(1.2, True, self.ranges, self.drift),
            ),
        )
        known = len(self.blocks) > 0
        rmse = sqrt(np.nanmean(self.blocks)) if known else nan
        return Assessment(
            None,
            {
                "estimation": {
                    "one_step_ahead": Metrics(nan, nan, self.trained, nan),
                    "free_run": Metrics(nan, nan, self.estimated, 100.0 * (1.0 - self.estimated)),
                },
                "validation": {"free_run": Metrics(nan, nan, rmse, nan)},
            },
            {"validation": {"free_run": OK if known else LOST}},
            None,
            SimpleNamespace(physics=physics),
            0,
            np.sqrt(np.asarray(self.blocks, dtype=float)),
        )


def chosen(*candidates, hysteresis=False):
    """Return the size of the recommended one of candidates that are sorted by their error."""
    ranked = sorted(candidates, key=lambda entry: np.mean(entry.blocks) if len(entry.blocks) else np.inf)
    found = recommend([entry.size for entry in ranked], [entry.assessment() for entry in ranked], hysteresis)
    assert found.reasons
    return ranked[found.rank - 1].size


def test_a_larger_model_that_is_better_by_chance_is_not_recommended():
    difference = 4e-6 * np.random.default_rng(1).standard_normal(20)
    luck = NOISE + difference - difference.mean() - 0.5e-6
    assert sqrt(luck.mean()) < sqrt(NOISE.mean())
    assert chosen(Candidate(3, NOISE), Candidate(9, luck)) == 3


@pytest.mark.parametrize(("excess", "size"), [(0.19, 3), (0.21, 9)])
def test_an_uncertain_excess_of_twenty_per_cent_justifies_a_term(excess, size):
    # One block has the whole difference, so two standard errors exceed it.
    blocks = NOISE.copy()
    blocks[4] += ((1 + excess) ** 2 - 1) * NOISE.sum()
    assert chosen(Candidate(3, blocks), Candidate(9, NOISE, estimated=BETTER)) == size


@pytest.mark.parametrize(
    ("excess", "estimated", "size"), [(0.49, 0.01, 3), (0.49, 0.0098, 9), (0.51, 0.01, 9), (0.49, nan, 3)]
)
def test_a_term_without_effect_on_the_estimation_data_is_not_justified(excess, estimated, size):
    small = Candidate(3, NOISE * (1 + excess) ** 2)
    assert chosen(small, Candidate(9, NOISE, estimated=estimated)) == size


@pytest.mark.parametrize(("estimated", "size"), [(0.0149, 3), (0.0151, 4), (0.2, 4), (nan, 4)])
def test_a_model_that_is_as_good_on_the_validation_data_alone_is_passed_over(estimated, size):
    by_chance = Candidate(3, NOISE, estimated=estimated)
    assert chosen(by_chance, Candidate(4, NOISE), Candidate(9, NOISE)) == size


@pytest.mark.parametrize(("estimated", "size"), [(0.0199, 3), (0.0201, 4), (nan, 4)])
def test_a_model_with_a_large_error_on_the_estimation_data_is_no_reference(estimated, size):
    assert chosen(Candidate(3, NOISE, estimated=estimated), Candidate(4, 4 * NOISE)) == size


def test_samples_without_a_prediction_do_not_hide_a_large_validation_error():
    warm_up = np.full(3, nan)
    right = Candidate(6, np.append(warm_up, NOISE), estimated=0.03)
    lucky = Candidate(6, np.append(warm_up, 25.0 * NOISE), estimated=0.01)
    assert recommend([6, 7], [right.assessment(), lucky.assessment()], False).rank == 1


def test_the_reason_states_which_better_models_are_left_out():
    entries = [Candidate(3, NOISE, estimated=0.2).assessment(), Candidate(4, 4 * NOISE).assessment()]
    least, error = sqrt(NOISE.mean()), sqrt(4 * NOISE.mean())
    assert recommend([3, 4], entries, False, "um").reasons[0] == (
        "least free-run error on the validation data of the models that are not left out, "
        f"RMSE {error:.4g} um; no smaller model is as good; left out: 1 (RMSE {least:.4g} um) with more than "
        "2 times the least error on the estimation data"
    )


def test_a_check_decides_between_models_that_the_data_do_not_distinguish():
    candidates = Candidate(3, NOISE, bounded=False), Candidate(5, 1.01 * NOISE)
    assert chosen(*candidates) == 5
    found = recommend([3, 5], [each.assessment() for each in candidates], False, "um")
    least, error = (sqrt(factor * NOISE.mean()) for factor in (1.0, 1.01))
    assert found.reasons[0] == (
        "smallest of 2 models whose free-run errors on the validation data do not differ significantly from "
        f"the least, except 1 (RMSE {least:.4g} um) with a divergence at rate x 5: RMSE {error:.4g} um, "
        f"least {least:.4g} um"
    )
    assert found.excluded == (Exclusion("physics-checks", (1,)),)
    assert chosen(Candidate(3, NOISE, bounded=False), Candidate(5, [])) == 3


def test_a_check_that_the_data_contradict_excludes_no_model():
    """A reaction runs away at a held input: models that cannot do so do not follow the record either."""
    candidates = [
        Candidate(7, NOISE, bounded=False),
        Candidate(4, 1.01 * NOISE, bounded=False),
        Candidate(2, 50 * NOISE, estimated=0.1),
    ]
    assert chosen(*candidates) == 4
    found = recommend([7, 4, 2], [each.assessment() for each in candidates], False, "um")
    assert found.reasons[0].startswith("smallest of 2 models")
    assert re.fullmatch(
        r"the data contradict the physics checks \(bounded at .* times the rate\): the models that pass them "
        r"have larger errors on the validation or the estimation data, 1 \(RMSE \S+ um\)",
        found.reasons[1],
    )
    assert found.excluded == (Exclusion("validation-error", (3,)),)


def largest(candidate, best):
    """Return the largest ratio of the errors on the validation data of equal models."""
    return 1.5 if candidate.estimated <= 1.01 * best.estimated else 1.01


def test_the_reason_states_every_excluded_model_that_the_criterion_would_prefer():
    generator = np.random.default_rng(8)
    for _ in range(200):
        made = [
            Candidate(
                int(generator.integers(1, 9)),
                NOISE * generator.choice([1.0, 1.01, 1.2, 5.0]),
                *(bool(each) for each in generator.integers(0, 2, 2)),
                estimated=generator.choice([0.01, 0.0101, 0.017, 0.05]),
            )
            for _ in range(6)
        ]
        made.sort(key=lambda each: np.mean(each.blocks))
        sizes, entries = [each.size for each in made], [each.assessment() for each in made]
        found = recommend(sizes, entries, hysteresis=bool(generator.integers(2)))
        excluded = [rank for each in found.excluded for rank in each.ranks]
        left = {*range(1, 7)}.difference(excluded)
        assert len(excluded) + len(left) == 6  # one reason for each
        assert min(sizes[rank - 1] for rank in left) == sizes[found.rank - 1]
        stated = sum(map(int, re.findall(r"(\d) \(RMSE", found.reasons[0])))
        errors = [entry.validation_error for entry in entries]
        best, least, size = made[found.reference - 1], errors[found.reference - 1], sizes[found.rank - 1]
        preferred = {
            rank
            for rank in excluded
            if errors[rank - 1] < least
            or (sizes[rank - 1] < size and errors[rank - 1] <= largest(made[rank - 1], best) * least)
        }
        assert stated == len(preferred)
        scoped = "of the models that are not left out" in found.reasons[0]
        assert scoped == ("; left out: " in found.reasons[0])
        assert scoped or min(errors) == least


def test_property_1_is_required_of_models_of_hysteresis_only():
    """The search requires it: a model without it is excluded, however small its error is."""
    candidates = Candidate(3, NOISE, property_1=False), Candidate(5, 9 * NOISE)
    assert chosen(*candidates, hysteresis=True) == 5
    assert chosen(*candidates) == 3
    found = recommend([3, 5], [each.assessment() for each in candidates], True)
    assert re.search(r"left out: 1 \(RMSE \S+\) without Property 1", found.reasons[0])
    only = Candidate(4, NOISE, property_1=False)
    found = recommend([4], [only.assessment()], True)
    assert found.reasons[1].startswith("no model passes the physics checks")


def test_the_first_model_is_recommended_if_every_free_run_diverges():
    found = recommend([5, 3], [Candidate(5, []).assessment(), Candidate(3, []).assessment()], False)
    assert found.rank == 1
    assert "diverges" in found.reasons[0]


def from_sample(first, errors):
    """Return squared errors of which the first samples are the warm-up."""
    return np.where(np.arange(len(errors)) < first, np.nan, errors)


@pytest.mark.parametrize("count", [2, 3, 10])
def test_means_are_compared_with_the_samples_of_the_same_part_of_the_data(count):
    errors = np.repeat(np.arange(1.0, 24.0), 3 * count)
    means = errors.reshape(-1, count).mean(axis=1)
    blocks = compare_blocks(from_sample(9 * count, errors), from_sample(3, means))
    assert blocks[0] == pytest.approx(blocks[1])


def test_the_fittest_model_is_recommended_although_its_free_run_diverges():
    entries = [
        Candidate(3, NOISE, trained=0.4),
        Candidate(9, [], bounded=False, trained=0.3),
        Candidate(5, [], trained=nan),
    ]
    found = recommend_fittest([entry.assessment() for entry in entries], "one_step_ahead", False, "um")
    assert found.rank == 2
    reason = "least error of the search on the estimation data (one step ahead), RMSE 0.3 um"
    assert found.reasons == (reason,)  # no claim that the model is bounded
    equal = [Candidate(9, NOISE, trained=0.4), Candidate(3, NOISE, trained=0.4)]
    found = recommend_fittest([entry.assessment() for entry in equal], "one_step_ahead", False)
    assert found.rank == 1
    assert found.reasons[1].startswith("bounded at inputs held at up to 1.2 times")


@pytest.mark.parametrize(
    ("ranges", "drift", "words"),
    [
        (0.9, 0.001, "bounded at inputs held at up to 1.2 times their recorded amplitude about"),
        (150.0, 0.0, "no divergence at inputs held at up to 1 times .* recorded range by up to 75 ranges"),
        (0.0, 0.1, r"no divergence at .* \(where the output is still moving at the end\), at 0.5 times"),
        (8.82, 2.1, r"\(where the output leaves .* by up to 8.82 ranges and is still moving at the end\)"),
    ],
)
def test_an_output_that_moves_on_at_held_inputs_is_not_said_to_be_bounded(ranges, drift, words):
    """The level of a tank left its recorded range by 8.8 ranges, and was bounded."""
    entry = Candidate(2, NOISE, ranges=ranges, drift=drift)
    reason = recommend([2], [entry.assessment()], hysteresis=False).reasons[1]
    assert re.match(f".*{words}", reason)
    assert ("bounded" in reason) == words.startswith("bounded")
