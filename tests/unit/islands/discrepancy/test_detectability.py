"""The self-test: surrogates are what they are said to be, and its answers hang on the seed alone."""

import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from islands.discrepancy.calibration.noise_model import fit_ar_noise
from islands.discrepancy.detectability import (
    NOTHING,
    UNKNOWN,
    SelfTest,
    SurrogateOutcome,
    diagnose_surrogate,
    estimate_rate,
    self_test,
)
from islands.discrepancy.diagnosis import Candidate, Diagnosis, diagnose
from islands.discrepancy.inference import noise_floor
from islands.discrepancy.interfaces.effect import Effect, Signal, SimulationContext
from islands.discrepancy.simulators.bouc_wen_piezo import BoucWenPiezoSimulator
from islands.discrepancy.simulators.recorded_output import RecordedOutput
from islands.discrepancy.surrogates import (
    STRENGTHS,
    Injection,
    SurrogateCase,
    Surrogates,
    injection_strengths,
    make_surrogates,
)
from islands.performance.trials.injection.measurement import inject
from islands.performance.trials.trial import TOLERANCE

CORE = BoucWenPiezoSimulator()
FEW = ("offset", "jump")


@pytest.fixture(scope="module", autouse=True)
def _small_reference() -> Iterator[None]:
    """Look with few random waves for what a residual still holds: that takes half of an analysis' time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noise_floor, "WAVES", 20)
        yield


def clean() -> Diagnosis:
    return diagnose(inject([], np.random.default_rng(5), 6.0).record, CORE, TOLERANCE)


@pytest.fixture(scope="module")
def source() -> Surrogates:
    return make_surrogates(clean(), CORE, TOLERANCE)


@pytest.fixture(scope="module")
def diagnosis(source: Surrogates, offered: Sequence[Effect]) -> Diagnosis:
    """Of a record with dry friction in it."""
    friction = next(each for each in offered if each.name == "coulomb-friction")
    return diagnose(source.draw_record(SurrogateCase(steps(source, friction)[-1], 11)), CORE, TOLERANCE)


@pytest.fixture(scope="module")
def offered(source: Surrogates) -> list[Effect]:
    return list(source.effects.values())


@pytest.fixture(scope="module")
def column(source: Surrogates) -> tuple[Diagnosis, RecordedOutput]:
    """A clean record beside somebody else's simulation of it: that takes a tenth of the time."""
    core = RecordedOutput("theirs", source.simulate())
    return diagnose(source.draw_record(SurrogateCase(None, 12)), core), core


@pytest.fixture(scope="module")
def tested(column: tuple[Diagnosis, RecordedOutput]) -> SelfTest:
    return self_test(*column, seed=3, effects=FEW, clean=1)


def steps(source: Surrogates, effect: Effect, seed: int = 0) -> tuple[Injection, ...]:
    return injection_strengths(source, effect, np.random.default_rng(seed))


def test_a_surrogate_is_the_simulation_and_noise_as_the_record_has_it() -> None:
    hiding = inject([], np.random.default_rng(5), 6.0, 0.8, apart=False)
    core = RecordedOutput("theirs", hiding.nominal)
    found = diagnose(hiding.record, core)
    source = make_surrogates(found, core, {})
    drawn = [source.draw_record(SurrogateCase(None, seed)) for seed in range(12)]
    assert all(np.array_equal(each.u, found.record.u) for each in drawn)
    noise = [each.y - source.simulate() for each in drawn]
    assert np.std(noise) == pytest.approx(source.sigma, rel=0.15)
    assert np.mean([fit_ar_noise(each).coefficients[0] for each in noise]) == pytest.approx(
        found.best.noise.coefficients[0], abs=0.1
    )


@pytest.mark.ci
def test_what_was_named_is_taken_off(diagnosis: Diagnosis) -> None:
    assert [each.name for each in diagnosis.effects] == ["coulomb-friction"]
    source = make_surrogates(diagnosis, CORE, TOLERANCE)
    assert source.sigma < 0.3 * np.sqrt(diagnosis.base.mean_square)
    assert np.std(diagnosis.best.output - source.simulate()) > 3 * source.sigma
    assert diagnose_surrogate(source, SurrogateCase(None, 1)).named == NOTHING


def test_to_inject_nothing_leaves_the_surrogate(source: Surrogates, offered: Sequence[Effect]) -> None:
    clean = source.draw_record(SurrogateCase(None, 7)).y
    for effect in offered:
        nominal = tuple(each.nominal for each in effect.parameters(source.simulation.context))
        nothing = Injection(effect.name, nominal, 0.0, "", 0.0)
        assert np.array_equal(source.draw_record(SurrogateCase(nothing, 7)).y, clean), effect.name


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.ci)])
def test_a_stronger_injection_has_a_larger_misfit(
    source: Surrogates, offered: Sequence[Effect], seed: int
) -> None:
    clean = source.draw_record(SurrogateCase(None, 7)).y
    for effect in offered:
        found = steps(source, effect, seed)
        assert found, effect.name
        sizes = [each.strength for each in found]
        misfits = [each.misfit for each in found]
        assert sizes == sorted(set(sizes)), effect.name
        assert misfits == sorted(set(misfits)), effect.name
        parameters = effect.parameters(source.simulation.context)
        for each in found:
            assert all(p.lower <= v <= p.upper for p, v in zip(parameters, each.values, strict=True))
            changed = (source.draw_record(SurrogateCase(each, 7)).y - clean)[: source.estimation_samples]
            assert np.sqrt(np.mean(changed**2)) == pytest.approx(each.misfit * source.sigma), effect.name


def test_misfits_are_those_of_the_ladder_where_nothing_leaps(
    source: Surrogates, offered: Sequence[Effect]
) -> None:
    offset = next(each for each in offered if each.name == "offset")
    assert [each.misfit for each in steps(source, offset)] == pytest.approx(list(STRENGTHS), rel=0.02)


def test_strengths_that_a_response_leaps_over_are_left_out(
    source: Surrogates, offered: Sequence[Effect]
) -> None:
    offset = next(each for each in offered if each.name == "offset")

    def leaping(y: Signal, values: Signal, _scene: SimulationContext) -> Signal:
        return y + source.sigma * (0.15 if abs(values[0]) < 1.0 else 2.0 if abs(values[0]) < 2.0 else np.inf)

    found = steps(source, replace(offset, form=leaping))
    assert [each.misfit for each in found] == pytest.approx([0.15, 2.0])


@pytest.mark.ci
def test_a_limit_is_a_strength_that_is_named(diagnosis: Diagnosis) -> None:
    found = self_test(diagnosis, CORE, TOLERANCE, 3, effects=("coulomb-friction",), clean=0)
    friction = found.detection_limits["coulomb-friction"]
    assert friction is not None
    assert friction.unit == "um"
    assert STRENGTHS[0] < friction.misfit < STRENGTHS[-2]
    # What is in the record was found there, and is above its limit.
    assert friction.strength < abs(diagnosis.effects[0].parameters["F"].value)
    assert found.confusion["coulomb-friction", "coulomb-friction"] >= 1
    assert found.confusion["coulomb-friction", NOTHING] >= 1


@pytest.mark.ci
def test_what_is_within_a_tolerance_has_no_limit(diagnosis: Diagnosis) -> None:
    wide = dict.fromkeys(TOLERANCE, 0.5)
    found = self_test(diagnosis, CORE, wide, 3, effects=("wrong-parameter:beta",), clean=0)
    assert found.detection_limits == {"wrong-parameter:beta": None}
    assert found.false_alarm_rate.trials == 0
    assert found.p_value == 1.0


def backwards(
    function: Callable[[SurrogateCase], SurrogateOutcome], probes: Sequence[SurrogateCase], /
) -> Iterable[SurrogateOutcome]:
    """Carry out probes in another process's order: copies of them, the last first."""
    function, probes = pickle.loads(pickle.dumps((function, probes)))
    return reversed([function(probe) for probe in reversed(probes)])


@pytest.mark.ci
def test_the_same_seed_has_the_same_result_in_any_order(
    column: tuple[Diagnosis, RecordedOutput], tested: SelfTest
) -> None:
    assert any(tested.detection_limits.values())
    again = self_test(*column, seed=3, run=backwards, effects=FEW, clean=1)
    assert again.detection_limits == tested.detection_limits
    assert again.false_alarm_rate == tested.false_alarm_rate
    assert again.p_value == tested.p_value
    assert again.confusion == tested.confusion


@pytest.mark.ci
def test_another_seed_has_another_result(column: tuple[Diagnosis, RecordedOutput], tested: SelfTest) -> None:
    other = self_test(*column, seed=4, effects=FEW[-1:], clean=0)
    assert other.detection_limits[FEW[-1]] != tested.detection_limits[FEW[-1]]


def test_an_effects_result_does_not_hang_on_the_others(
    column: tuple[Diagnosis, RecordedOutput], tested: SelfTest
) -> None:
    alone = self_test(*column, seed=3, effects=FEW[-1:], clean=0)
    assert alone.detection_limits == {FEW[-1]: tested.detection_limits[FEW[-1]]}


def answering(
    called: str, score: float, recognised: bool = False
) -> Callable[..., Iterable[SurrogateOutcome]]:
    return lambda _function, probes: [SurrogateOutcome(called, recognised, score) for _ in probes]


def test_p_is_one_in_n_and_one_where_the_record_beats_all(diagnosis: Diagnosis) -> None:
    best = replace(diagnosis, candidates=(Candidate("delay", 3.0, 0.1), Candidate("offset", 50.0, 0.5)))
    for score, p in ((49.9, 1 / 21), (50.0, 1.0)):
        found = self_test(best, CORE, TOLERANCE, 0, answering(NOTHING, score), (), 20)
        assert found.p_value == pytest.approx(p)


@pytest.mark.parametrize(("called", "value"), [("delay", 1.0), (NOTHING, 0.0), (UNKNOWN, 0.0)])
def test_a_false_alarm_is_a_name(diagnosis: Diagnosis, called: str, value: float) -> None:
    found = self_test(diagnosis, CORE, TOLERANCE, 0, answering(called, 0.0), (), 20)
    assert found.false_alarm_rate == estimate_rate(int(20 * value), 20)
    assert found.false_alarm_rate.value == value
    assert found.confusion == {(NOTHING, called): 20}


def test_the_limit_is_where_naming_begins(diagnosis: Diagnosis, source: Surrogates) -> None:
    """Whichever step it is, four probes find it at the most."""
    for first in range(len(STRENGTHS) + 1):
        asked = []

        def run(
            _function: object,
            probes: Sequence[SurrogateCase],
            first: int = first,
            asked: list[SurrogateCase] = asked,
        ) -> Iterable[SurrogateOutcome]:
            asked += probes
            for probe in probes:
                assert probe.injection is not None
                named = first < len(STRENGTHS) and probe.injection.misfit > 0.9 * STRENGTHS[first]
                yield SurrogateOutcome("offset" if named else NOTHING, named, 0.0)

        found = self_test(diagnosis, CORE, TOLERANCE, 0, run, ("offset",), 0)
        limit = found.detection_limits["offset"]
        if first == len(STRENGTHS):
            assert limit is None
        else:
            assert limit is not None
            assert limit.misfit == pytest.approx(STRENGTHS[first], rel=0.02)
        assert len(asked) <= 4


def test_who_waits_is_told_how_far_it_is(diagnosis: Diagnosis) -> None:
    told: list[tuple[str, float | None]] = []
    self_test(
        *(diagnosis, CORE, TOLERANCE, 0, answering(NOTHING, 0.0), ("offset",), 2),
        progress=lambda message, fraction=None: told.append((message, fraction)),
    )
    assert told == [(f"{ended} of 6 analyses", ended / 6) for ended in range(1, 7)]


def test_noise_that_was_fitted_to_a_drift_stays_finite(diagnosis: Diagnosis) -> None:
    left = np.concatenate(
        [1e-3 * 1.02 ** np.arange(diagnosis.estimation_samples), np.zeros(diagnosis.record.samples)]
    )
    left = left[: diagnosis.record.samples]
    record = replace(diagnosis.record, y=diagnosis.best.output + left)
    assert (
        np.abs(np.roots([1.0, *-fit_ar_noise(left[: diagnosis.estimation_samples]).coefficients])).max() > 1.0
    )
    source = make_surrogates(replace(diagnosis, record=record), CORE, TOLERANCE)
    assert np.abs(np.roots([1.0, *-source.noise.coefficients])).max() < 1.0
    assert np.isfinite(source.draw_record(SurrogateCase(None, 0)).y).all()


def test_bounds_are_those_of_clopper_and_pearson() -> None:
    assert estimate_rate(0, 40).ci95 == pytest.approx((0.0, 0.0881), abs=1e-4)
    assert estimate_rate(2, 40).ci95 == pytest.approx((0.0061, 0.1692), abs=1e-4)
    assert estimate_rate(40, 40).ci95[1] == 1.0
