"""Fault injection: accurate plants, misfits within the band, and reproducible records."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from lab.diagnosis.injection import force_faults, signal_faults
from lab.diagnosis.injection.excitation import Excitation
from lab.diagnosis.injection.measurement import FaultyRecord, inject
from lab.diagnosis.injection.noise import NOISES
from lab.diagnosis.injection.oscillator import OSCILLATOR, OUTPUT, SPEED, Oscillator
from lab.diagnosis.injection.piezo import PIEZO, Piezo
from lab.diagnosis.injection.plant import Force, simulate_plant
from lab.diagnosis.injection.tanks import TANKS, Tanks

#: Every system, with the length of a short record in seconds.
SYSTEMS = {"piezo": (PIEZO, 5.0), "oscillator": (OSCILLATOR, 4.0), "tanks": (TANKS, 2048.0)}


def faulty_record(system: str, *names: str, seed: int = 1, **options: object) -> FaultyRecord:
    rig, seconds = SYSTEMS[system]
    return inject(names, np.random.default_rng(seed), seconds, system=rig, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("variant", [False, True], ids=["standard", "variant"])
@pytest.mark.parametrize("system", ["piezo", "tanks", "oscillator"])
def test_every_fault_reaches_a_band_of_misfits(system: str, variant: bool) -> None:
    for name in SYSTEMS[system][0].known:
        found = faulty_record(system, name, band=(0.3, 2.0), variant=variant)
        assert 0.3 <= found.misfit <= 2.0, name
        assert np.isfinite(found.record.y).all(), name


@pytest.mark.parametrize("system", SYSTEMS)
def test_unknown_faults_are_visible(system: str) -> None:
    for name in SYSTEMS[system][0].unknown:
        assert faulty_record(system, name).misfit > 0.5, name


@pytest.mark.parametrize("system", SYSTEMS)
def test_equal_seeds_inject_equal_faults(system: str) -> None:
    first, again, other = (faulty_record(system, "jump", "delay", seed=seed) for seed in (5, 5, 6))
    assert np.array_equal(first.record.y, again.record.y)
    assert not np.array_equal(first.record.u, other.record.u)


@pytest.mark.parametrize("system", SYSTEMS)
def test_a_clean_record_has_noise_only(system: str) -> None:
    found = faulty_record(system, perturbed=False)
    left = found.record.y - found.nominal
    assert found.misfit == 0.0
    assert np.std(left) == pytest.approx(found.sigma, rel=0.1)
    assert np.std(faulty_record(system).record.y - found.nominal) > 1.1 * found.sigma


@pytest.mark.parametrize("steps", [0.2, 1.0, 20.0])
def test_lags_are_late_by_their_time_constant_also_within_a_step(steps: float) -> None:
    """A ramp of rate one is late by the time constant in the steady state."""
    rate, samples = 100.0, 2000
    tau, time = steps / rate, np.arange(samples) / rate
    assert time[-1] - signal_faults.lag(time, tau, rate)[-1] == pytest.approx(tau, rel=1e-9)
    drive = Excitation(time, time, time, time, rate, 1.0, 1e3)
    shown = signal_faults.growing_lag(np.random.default_rng(0), tau)(drive, time)
    assert time[-1] - shown[-1] == pytest.approx(tau, rel=0.15)


@pytest.mark.parametrize("steps", [0.3, 0.5, 2.5])
def test_a_delay_has_the_gain_of_a_delay(steps: float) -> None:
    """A signal that is linear between samples would lose 0.4 % by a delay of half a step of these 35."""
    time = np.arange(700) / 100.0
    u = np.sin(2.0 * np.pi * time * 100.0 / 35.0)
    drive = Excitation(time, u, u, u, 100.0, 1.0, 1.0)
    late = signal_faults.delay(np.random.default_rng(0), steps / 100.0)(drive, u)[35:]
    exact = np.sin(2.0 * np.pi * (time * 100.0 - steps) / 35.0)[35:]
    assert np.std(late - exact) < 1e-3 * np.std(exact)


def test_changes_within_tolerances_are_not_a_misfit() -> None:
    """For a gain error, only the part that no admissible parameters absorb counts."""
    gain = PIEZO.known["sensor-gain"]
    small, large = (
        replace(PIEZO, known={"sensor-gain": replace(gain, minimum=k, maximum=k)}) for k in (0.015, 0.08)
    )
    allowed, off, in_full = (
        inject(["sensor-gain"], np.random.default_rng(3), 12.0, system=system, perturbed=apart)
        for system, apart in ((small, True), (large, True), (small, False))
    )
    assert allowed.misfit < 0.05
    assert off.misfit > 1.0
    assert in_full.misfit > 1.0


def test_a_fault_next_to_a_gain_error_keeps_its_misfit() -> None:
    assert faulty_record("piezo", "sensor-gain", "periodic-disturbance", band=(2.0, 3.0)).misfit > 2.0


@pytest.mark.parametrize("force", [force_faults.cube, force_faults.drag, force_faults.hysteresis, None])
def test_the_oscillator_matches_a_reference_solution(force: object) -> None:
    rng = np.random.default_rng(2)
    made: tuple[Force, ...] = () if force is None else (force(rng, 0.1),)  # type: ignore[operator]
    plant = Oscillator(forces=made)
    drive = OSCILLATOR.excitation(rng, 2.0)
    y = simulate_plant(plant, drive)

    def slope(t: float, state: np.ndarray) -> list[float]:
        x, v, z = state
        strength, change = made[0](x / OUTPUT, v / SPEED, z) if made else (0.0, 0.0)
        u = np.interp(t, drive.time, drive.u)
        total = u + plant.k * OUTPUT * strength - plant.c * v - plant.k * x
        return [v, total / plant.m, change * v / OUTPUT]

    ideal = scipy.integrate.solve_ivp(
        slope, (0.0, drive.time[-1]), [0.0, 0.0, 0.0], t_eval=drive.time, max_step=5e-4, rtol=1e-6
    ).y[0]
    assert np.max(np.abs(y - ideal)) < 2e-3 * np.max(np.abs(y))


def test_the_tanks_match_a_reference_solution() -> None:
    drive = TANKS.excitation(np.random.default_rng(2), 800.0)
    plant = Tanks(leaks=(0.002, 0.001), inflows=(0.01, -0.005))

    def slope(t: float, x: np.ndarray) -> list[float]:
        fallen = plant.k1 * np.sqrt(x[0]) + 0.002 * x[0]
        filled = plant.k4 * np.interp(t, drive.time, drive.u)
        return [filled + 0.01 - fallen, fallen - 0.005 - plant.k3 * np.sqrt(x[1]) - 0.001 * x[1]]

    ideal = scipy.integrate.solve_ivp(
        slope, (0.0, drive.time[-1]), plant.start, t_eval=drive.time, max_step=1.0, rtol=1e-8
    ).y[1]
    assert np.max(np.abs(simulate_plant(plant, drive) - ideal)) < 1e-3


def test_a_tank_overflows_at_its_edge_into_the_lower_tank() -> None:
    drive = TANKS.excitation(np.random.default_rng(2), 4096.0)
    free = simulate_plant(Tanks(), drive)
    lower = simulate_plant(Tanks(overflow_depths=(0.0, 0.2)), drive)
    lost, caught = (
        simulate_plant(Tanks(overflow_depths=(0.3, 0.0), spill_fraction=part), drive) for part in (0.0, 1.0)
    )
    assert lower.max() == pytest.approx(0.8 * free.max())
    assert lost.max() < free.max()
    assert caught.mean() > lost.mean()


def test_a_gain_step_changes_the_output_only_after_its_time() -> None:
    for system, plant in ((PIEZO, Piezo()), (OSCILLATOR, Oscillator()), (TANKS, Tanks())):
        drive = system.excitation(np.random.default_rng(2), 0.3 * system.seconds)
        half = float(drive.time[-1]) / 2
        changed = simulate_plant(
            replace(plant, gain_profile=lambda time, half=half: 1.0 + 0.1 * (time > half)), drive
        )
        moved = np.abs(changed - simulate_plant(plant, drive)) > 1e-9
        assert not moved[: moved.size // 2].any()
        assert moved[moved.size // 2 + 10 :].mean() > 0.9


@pytest.mark.parametrize("kind", NOISES)
def test_noise_has_unit_size_and_its_colour(kind: str) -> None:
    clean = 20.0 * np.sin(np.arange(4000) / 30)
    noise = NOISES[kind](np.random.default_rng(1), clean)
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(1.0, rel=0.25)
    power = np.abs(np.fft.rfft(noise)) ** 2
    slow = np.mean(power[1:40]) / np.mean(power[-400:])
    is_white = kind in ("white", "multiplicative", "heavy-tailed", "non-stationary", "closed-loop")
    assert (0.4 < slow < 2.5) if is_white else slow > 5.0


def test_controller_carries_noise_to_later_inputs() -> None:
    opened, closed = (faulty_record("piezo", seed=3, noise=noise) for noise in ("white", "closed-loop"))
    action = closed.record.u[:, 0] - opened.record.u[:, 0]
    errors = opened.record.y - faulty_record("piezo", seed=3, noise="white").nominal
    assert np.std(action) > 0.0
    # The controller acts against the errors that it has read, not against those to come.
    assert np.corrcoef(action[1:], errors[:-1])[0, 1] < -0.05
    assert action[0] == 0.0
