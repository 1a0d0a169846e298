"""Recommended model: the simplest one with the most evidence, bounded, and with the claimed physics."""

import re
from dataclasses import dataclass, replace
from math import nan, sqrt
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.simulation.outcome import OK, EvaluationOutcome, Status
from islands.validation import recommendation
from islands.validation.assessment import Assessment
from islands.validation.metrics import Metrics
from islands.validation.physics import ClusterSum, ExcursionTest, ExtremeTest, HoldTest, PhysicsChecks
from islands.validation.recommendation import Exclusion
from islands.validation.recommendation_reasons import list_rivals, state_fit, state_reasons
from support.assessments import StatedChecks

LOST = EvaluationOutcome(Status.DIVERGED, "at sample 3")

#: Squared errors of white noise with an RMSE of 1 %.
NOISE = 1e-4 * np.random.default_rng(0).standard_normal(200) ** 2

#: White noise of variance 1: the errors of a `Candidate` on the estimation data, and the signs of the others.
WHITE = np.random.default_rng(1).choice([-1.0, 1.0], 1000)

#: Samples of the estimation data of a `Candidate`.
SAMPLES = 600


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
    errors: np.ndarray | None = None

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
            SimpleNamespace(free_size=self.size),
            {
                "estimation": {
                    "one_step_ahead": Metrics(nan, nan, self.trained, nan),
                    "free_run": Metrics(nan, nan, self.estimated, 100.0 * (1.0 - self.estimated)),
                },
                "validation": {"free_run": Metrics(nan, nan, rmse, nan)},
            },
            {"validation": {"free_run": OK if known else LOST}},
            None,
            StatedChecks(physics=physics, split=SimpleNamespace(segments=())),
            0,
            StatedChecks(errors=self.make_errors() if self.errors is None else self.errors),
        )

    def make_errors(self):
        validation = WHITE[SAMPLES:][: len(self.blocks)] * np.sqrt(self.blocks)
        return np.append(self.estimated * WHITE[:SAMPLES], validation if len(self.blocks) else np.inf)


def recommend(entries, hysteresis, unit="", accurate=False):
    """Return a recommendation with its reasons."""
    found = recommendation.recommend(entries, hysteresis, accurate)
    return replace(found, reasons=state_reasons(found, entries, hysteresis, unit, accurate))


def recommend_fittest(entries, mode, hysteresis, unit=""):
    found = recommendation.recommend_fittest(entries, mode)
    return replace(found, reasons=state_fit(entries[found.rank - 1], mode, hysteresis, unit))


def chosen(*candidates, hysteresis=False):
    """Return the size of the recommended one of candidates that are sorted by their error."""
    ranked = sorted(candidates, key=lambda entry: np.mean(entry.blocks) if len(entry.blocks) else np.inf)
    found = recommend([entry.assessment() for entry in ranked], hysteresis)
    assert found.reasons
    return ranked[found.rank - 1].size


def test_a_larger_model_that_is_better_by_chance_is_not_recommended():
    assert chosen(Candidate(3, NOISE), Candidate(9, 0.99 * NOISE, estimated=0.00995)) == 3


@pytest.mark.parametrize(("gain", "size"), [(1.005, 3), (1.1, 9)])
def test_further_terms_need_a_gain_that_exceeds_their_cost_on_all_data(gain, size):
    small = Candidate(3, gain**2 * NOISE, estimated=gain * 0.01)
    assert chosen(small, Candidate(9, NOISE)) == size


def test_the_estimation_data_count_where_the_validation_data_rest():
    """After one bump, a constant is as good on the rest of the record as any model."""
    assert chosen(Candidate(1, NOISE, estimated=0.3), Candidate(4, 1.01 * NOISE)) == 4


@pytest.mark.parametrize(("pole", "size"), [(0.0, 9), (0.98, 3)])
def test_a_slow_error_counts_little_where_the_noise_is_slow(pole, size):
    noise = lfilter([0.01 * sqrt(1.0 - pole**2)], [1.0, -pole], np.random.default_rng(0).standard_normal(800))
    slow = 0.005 * np.sin(np.linspace(0.0, 2.0 * np.pi, 800))
    errors = noise + slow - slow * (slow @ noise) / (slow @ slow)  # the larger model has the smaller errors
    assert chosen(Candidate(3, 1.1 * NOISE, errors=errors), Candidate(9, NOISE, errors=errors - slow)) == size


def test_samples_without_a_prediction_do_not_hide_a_large_validation_error():
    warm_up = np.full(3, nan)
    right = Candidate(6, np.append(warm_up, NOISE), estimated=0.0101)
    lucky = Candidate(7, np.append(warm_up, 25.0 * NOISE), estimated=0.01)
    assert recommend([right.assessment(), lucky.assessment()], False).rank == 1


def test_a_check_decides_between_models_that_the_data_do_not_distinguish():
    candidates = Candidate(4, NOISE, bounded=False), Candidate(5, 1.01 * NOISE)
    assert chosen(*candidates) == 5
    found = recommend([each.assessment() for each in candidates], False, "um")
    least, error = (sqrt(factor * NOISE.mean()) for factor in (1.0, 1.01))
    assert found.reasons[0] == (
        "smallest of the models whose evidence (information criterion of the free run on all data) does not "
        f"differ decisively: RMSE on the validation data {error:.4g} um, {least:.4g} um of the model with "
        f"the most evidence; left out: 1 (RMSE {least:.4g} um) with a divergence at rate x 5"
    )
    assert found.excluded == (Exclusion("physics-checks", (1,)),)
    assert chosen(Candidate(3, NOISE, bounded=False), Candidate(5, [])) == 3


def test_a_user_who_prefers_accuracy_gets_the_most_evidence_of_the_sound_models():
    candidates = Candidate(3, 1.03 * NOISE), Candidate(4, NOISE, estimated=0.00995)
    entries = [each.assessment() for each in candidates]
    assert recommend(entries, False).rank == 1
    found = recommend(entries, False, accurate=True)
    assert found.rank == 2
    assert found.reasons[0].startswith("most evidence")
    entries[1] = replace(candidates[1], bounded=False).assessment()
    assert recommend(entries, False, accurate=True).rank == 1


def test_a_check_that_the_data_contradict_excludes_no_model():
    """A reaction runs away at a held input: models that cannot do so do not follow the record either."""
    candidates = [
        Candidate(7, NOISE, bounded=False),
        Candidate(4, 1.01 * NOISE, bounded=False),
        Candidate(2, 50 * NOISE, estimated=0.1),
    ]
    assert chosen(*candidates) == 4
    found = recommend([each.assessment() for each in candidates], False, "um")
    assert found.reasons[0].startswith("most evidence")
    assert re.fullmatch(
        r"the data contradict the physics checks \(bounded at .* times the rate\): the models that pass them "
        r"have larger errors on the validation or the estimation data, 1 \(RMSE \S+ um\)",
        found.reasons[1],
    )
    assert found.excluded == (Exclusion("evidence", (1, 3)),)


def test_a_divergence_needs_a_smaller_validation_error_than_that_of_every_sound_model():
    sound = Candidate(9, 0.98 * NOISE, estimated=0.013)
    assert chosen(sound, Candidate(5, NOISE, bounded=False)) == 9
    assert chosen(replace(sound, blocks=1.02 * NOISE), Candidate(5, NOISE, bounded=False)) == 5


def test_every_model_is_left_or_excluded_once_and_the_smallest_left_is_recommended():
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
        found = recommend(entries, hysteresis=bool(generator.integers(2)))
        excluded = [rank for each in found.excluded for rank in each.ranks]
        left = {*range(1, 7)}.difference(excluded)
        assert len(excluded) + len(left) == 6
        assert min(sizes[rank - 1] for rank in left) == sizes[found.rank - 1]
        assert ("left out" in found.reasons[0]) == bool(list_rivals(found, entries))


def test_property_1_is_required_of_models_of_hysteresis_only():
    """The search requires it: a model without it is excluded, however small its error is."""
    candidates = Candidate(3, NOISE, property_1=False), Candidate(5, 9 * NOISE)
    assert chosen(*candidates, hysteresis=True) == 5
    assert chosen(*candidates) == 3
    found = recommend([each.assessment() for each in candidates], True)
    assert re.search(r"left out: 1 \(RMSE \S+\) without Property 1", found.reasons[0])
    only = Candidate(4, NOISE, property_1=False)
    found = recommend([only.assessment()], True)
    assert found.reasons[1].startswith("no model passes the physics checks")


def test_the_first_model_is_recommended_if_every_free_run_diverges():
    found = recommend([Candidate(5, []).assessment(), Candidate(3, []).assessment()], False)
    assert found.rank == 1
    assert "diverges" in found.reasons[0]


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
    reason = recommend([entry.assessment()], hysteresis=False).reasons[1]
    assert re.match(f".*{words}", reason)
    assert ("bounded" in reason) == words.startswith("bounded")
