"""Self-test: surrogates, detection limits, false-alarm rate, and dependence on the seed alone."""

import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.detectability import NOTHING, STRENGTHS, Injection, SelfTest
from islands.diagnosis.inference import noise_floor
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Candidate, Diagnosis
from islands.effects.interface.context import Signal, SimulationContext
from islands.effects.interface.effect import Effect
from islands.records.noise_model import fit_noise
from islands.simulators.external import RecordedOutput
from lab.diagnosis.injection.measurement import inject
from lab.diagnosis.self_test import (
    UNKNOWN,
    SurrogateOutcome,
    diagnose_surrogate,
    estimate_rate,
    self_test,
)
from lab.diagnosis.surrogates import SurrogateCase, Surrogates, injection_strengths, make_surrogates
from lab.diagnosis.trial import TOLERANCE
from support.built_in_simulators import make_piezo

SIMULATOR = make_piezo()

#: Effects that most tests inject.
INJECTED = ("offset", "jump")


@pytest.fixture(scope="module", autouse=True)
def _few_random_features() -> Iterator[None]:
    """Use few random features for the noise floor, which takes half of the time of a diagnosis."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noise_floor, "RANDOM_FEATURES", 20)
        yield


def diagnose_clean_record() -> Diagnosis:
    return diagnose(inject([], np.random.default_rng(5), 6.0).record, SIMULATOR, TOLERANCE)


@pytest.fixture(scope="module")
def surrogates() -> Surrogates:
    return make_surrogates(diagnose_clean_record(), SIMULATOR, TOLERANCE)


@pytest.fixture(scope="module")
def diagnosis(surrogates: Surrogates, effects: Sequence[Effect]) -> Diagnosis:
    """Diagnosis of a record with dry friction."""
    friction = next(each for each in effects if each.name == "coulomb-friction")
    return diagnose(
        surrogates.draw_record(SurrogateCase(make_injections(surrogates, friction)[-1], 11)),
        SIMULATOR,
        TOLERANCE,
    )


@pytest.fixture(scope="module")
def effects(surrogates: Surrogates) -> list[Effect]:
    return list(surrogates.effects.values())


@pytest.fixture(scope="module")
def column(surrogates: Surrogates) -> tuple[Diagnosis, RecordedOutput]:
    """A clean record and its recorded simulation, which takes a tenth of the time."""
    simulator = RecordedOutput("theirs", surrogates.simulate())
    return diagnose(surrogates.draw_record(SurrogateCase(None, 12)), simulator), simulator


@pytest.fixture(scope="module")
def tested(column: tuple[Diagnosis, RecordedOutput]) -> SelfTest:
    return self_test(*column, seed=3, effects=INJECTED, clean_surrogates=1)


def make_injections(surrogates: Surrogates, effect: Effect, seed: int = 0) -> tuple[Injection, ...]:
    return injection_strengths(surrogates, effect, np.random.default_rng(seed))


def test_surrogate_is_the_simulation_plus_noise_of_the_record() -> None:
    faulty = inject([], np.random.default_rng(5), 6.0, "ar", perturbed=False)
    simulator = RecordedOutput("theirs", faulty.nominal)
    found = diagnose(faulty.record, simulator)
    surrogates = make_surrogates(found, simulator, {})
    drawn = [surrogates.draw_record(SurrogateCase(None, seed)) for seed in range(12)]
    assert all(np.array_equal(each.u, found.record.u) for each in drawn)
    noise = [each.y - surrogates.simulate() for each in drawn]
    assert np.std(noise) == pytest.approx(surrogates.sigma, rel=0.15)
    assert np.mean([fit_noise(each).coefficients[0] for each in noise]) == pytest.approx(
        found.best.noise.coefficients[0], abs=0.1
    )


def test_clean_surrogates_do_not_contain_the_named_effect(diagnosis: Diagnosis) -> None:
    assert [each.name for each in diagnosis.effects] == ["coulomb-friction"]
    surrogates = make_surrogates(diagnosis, SIMULATOR, TOLERANCE)
    assert surrogates.sigma < 0.3 * np.sqrt(diagnosis.base.mean_square)
    assert np.std(diagnosis.best.output - surrogates.simulate()) > 3 * surrogates.sigma
    assert diagnose_surrogate(surrogates, SurrogateCase(None, 1)).named == NOTHING


@pytest.mark.parametrize("seed", [0, 1])
def test_stronger_injection_has_a_larger_misfit(
    surrogates: Surrogates, effects: Sequence[Effect], seed: int
) -> None:
    clean = surrogates.draw_record(SurrogateCase(None, 7)).y
    for effect in effects:
        found = make_injections(surrogates, effect, seed)
        assert found, effect.name
        sizes = [each.strength for each in found]
        misfits = [each.misfit for each in found]
        assert sizes == sorted(set(sizes)), effect.name
        assert misfits == sorted(set(misfits)), effect.name
        parameters = effect.parameters(surrogates.simulation.context)
        for each in found:
            assert all(p.lower <= v <= p.upper for p, v in zip(parameters, each.values, strict=True))
            changed = (surrogates.draw_record(SurrogateCase(each, 7)).y - clean)[
                : surrogates.estimation_samples
            ]
            assert np.sqrt(np.mean(changed**2)) == pytest.approx(each.misfit * surrogates.sigma), effect.name


def test_misfits_of_a_continuous_response_are_the_given_ones(
    surrogates: Surrogates, effects: Sequence[Effect]
) -> None:
    offset = next(each for each in effects if each.name == "offset")
    assert [each.misfit for each in make_injections(surrogates, offset)] == pytest.approx(
        list(STRENGTHS), rel=0.02
    )


def test_misfits_that_a_response_jumps_over_are_skipped(
    surrogates: Surrogates, effects: Sequence[Effect]
) -> None:
    offset = next(each for each in effects if each.name == "offset")

    def jump(y: Signal, values: Signal, _context: SimulationContext) -> Signal:
        return y + surrogates.sigma * (
            0.15 if abs(values[0]) < 1.0 else 2.0 if abs(values[0]) < 2.0 else np.inf
        )

    found = make_injections(surrogates, replace(offset, form=jump))
    assert [each.misfit for each in found] == pytest.approx([0.15, 2.0])


def test_detection_limit_is_a_strength_that_is_recognised(diagnosis: Diagnosis) -> None:
    found = self_test(diagnosis, SIMULATOR, TOLERANCE, 3, effects=("coulomb-friction",), clean_surrogates=0)
    friction = found.detection_limits["coulomb-friction"]
    assert friction is not None
    assert friction.unit == "um"
    assert STRENGTHS[0] < friction.misfit < STRENGTHS[-2]
    # The friction in the record was found, so that it is above the limit.
    assert friction.strength < abs(diagnosis.effects[0].parameters["F"].value)
    assert found.confusion["coulomb-friction", "coulomb-friction"] >= 1
    assert any(found.confusion.get(("coulomb-friction", missed), 0) for missed in (NOTHING, UNKNOWN))


def test_parameter_within_its_tolerance_has_no_detection_limit(diagnosis: Diagnosis) -> None:
    wide = dict.fromkeys(TOLERANCE, 0.5)
    found = self_test(diagnosis, SIMULATOR, wide, 3, effects=("wrong-parameter:beta",), clean_surrogates=0)
    assert found.detection_limits == {"wrong-parameter:beta": None}
    assert found.false_alarm_rate.trials == 0
    assert found.p_value == 1.0


def backwards(
    function: Callable[[SurrogateCase], SurrogateOutcome], cases: Sequence[SurrogateCase], /
) -> Iterable[SurrogateOutcome]:
    """Evaluate pickled copies of the cases, the last one first."""
    function, cases = pickle.loads(pickle.dumps((function, cases)))
    return reversed([function(case) for case in reversed(cases)])


def test_result_does_not_depend_on_the_order_of_evaluation(
    column: tuple[Diagnosis, RecordedOutput], tested: SelfTest
) -> None:
    assert any(tested.detection_limits.values())
    again = self_test(*column, seed=3, parallel_map=backwards, effects=INJECTED, clean_surrogates=1)
    assert again.detection_limits == tested.detection_limits
    assert again.false_alarm_rate == tested.false_alarm_rate
    assert again.p_value == tested.p_value
    assert again.confusion == tested.confusion


def test_detection_limit_does_not_depend_on_other_effects(
    column: tuple[Diagnosis, RecordedOutput], tested: SelfTest
) -> None:
    alone = self_test(*column, seed=3, effects=INJECTED[-1:], clean_surrogates=0)
    assert alone.detection_limits == {INJECTED[-1]: tested.detection_limits[INJECTED[-1]]}


def stub_map(named: str, score: float, recognised: bool = False) -> Callable[..., Iterable[SurrogateOutcome]]:
    """Return a map that gives the same outcome for every case."""
    return lambda _function, cases: [SurrogateOutcome(named, recognised, score) for _ in cases]


def test_p_value_counts_surrogates_as_good_as_the_record(diagnosis: Diagnosis) -> None:
    best = replace(diagnosis, candidates=(Candidate("delay", 3.0, 0.1), Candidate("offset", 50.0, 0.5)))
    for score, p in ((49.9, 1 / 21), (50.0, 1.0)):
        found = self_test(best, SIMULATOR, TOLERANCE, 0, stub_map(NOTHING, score), (), 20)
        assert found.p_value == pytest.approx(p)


@pytest.mark.parametrize(("named", "value"), [("delay", 1.0), (NOTHING, 0.0), (UNKNOWN, 0.0)])
def test_false_alarm_is_a_named_cause(diagnosis: Diagnosis, named: str, value: float) -> None:
    found = self_test(diagnosis, SIMULATOR, TOLERANCE, 0, stub_map(named, 0.0), (), 20)
    assert found.false_alarm_rate == estimate_rate(int(20 * value), 20)
    assert found.false_alarm_rate.value == value
    assert found.confusion == {(NOTHING, named): 20}


def test_detection_limit_is_the_smallest_recognised_strength(
    diagnosis: Diagnosis, surrogates: Surrogates
) -> None:
    """The bisection takes at most four surrogates."""
    for first in range(len(STRENGTHS) + 1):
        evaluated = []

        def evaluate(
            _function: object,
            cases: Sequence[SurrogateCase],
            first: int = first,
            evaluated: list[SurrogateCase] = evaluated,
        ) -> Iterable[SurrogateOutcome]:
            evaluated += cases
            for case in cases:
                assert case.injection is not None
                is_named = first < len(STRENGTHS) and case.injection.misfit > 0.9 * STRENGTHS[first]
                yield SurrogateOutcome("offset" if is_named else NOTHING, is_named, 0.0)

        found = self_test(diagnosis, SIMULATOR, TOLERANCE, 0, evaluate, ("offset",), 0)
        limit = found.detection_limits["offset"]
        if first == len(STRENGTHS):
            assert limit is None
        else:
            assert limit is not None
            assert limit.misfit == pytest.approx(STRENGTHS[first], rel=0.02)
        assert len(evaluated) <= 4


def test_noise_model_fitted_to_a_drift_is_stable(diagnosis: Diagnosis) -> None:
    drift = np.concatenate(
        [1e-3 * 1.02 ** np.arange(diagnosis.estimation_samples), np.zeros(diagnosis.record.samples)]
    )
    drift = drift[: diagnosis.record.samples]
    record = replace(diagnosis.record, y=diagnosis.best.output + drift)
    assert (
        np.abs(np.roots([1.0, *-fit_noise(drift[: diagnosis.estimation_samples]).coefficients])).max() > 1.0
    )
    surrogates = make_surrogates(replace(diagnosis, record=record), SIMULATOR, TOLERANCE)
    assert np.abs(np.roots([1.0, *-surrogates.noise.coefficients])).max() < 1.0
    assert np.isfinite(surrogates.draw_record(SurrogateCase(None, 0)).y).all()


def test_confidence_interval_is_clopper_pearson() -> None:
    assert estimate_rate(0, 40).ci95 == pytest.approx((0.0, 0.0881), abs=1e-4)
    assert estimate_rate(2, 40).ci95 == pytest.approx((0.0061, 0.1692), abs=1e-4)
    assert estimate_rate(40, 40).ci95[1] == 1.0
