"""Simulated measurements of a plant with injected faults: decimated and with noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from islands.records.dataset import Dataset
from lab.diagnosis.injection.excitation import Excitation, Signal
from lab.diagnosis.injection.faults import Fault, Inject, alter_parameter
from lab.diagnosis.injection.noise import FED_BACK, NOISES
from lab.diagnosis.injection.piezo import PIEZO
from lab.diagnosis.injection.plant import Plant, simulate_plant
from lab.diagnosis.injection.rig import Rig

#: Fraction of a record, from its start, in which faults must be visible; the rest may be held out.
VISIBLE_FRACTION = 0.75

#: Faults that calibration can absorb. Only the part that remains after calibration is visible.
GAIN_FAULTS = ("sensor-gain", "input-gain", "wrong-parameter")

#: Fraction of clean records whose parameters exceed the allowed deviation from their nominal values. An
#: analysis that reports smaller deviations as wrong parameters has more false names than this.
_EXCESS_PROBABILITY = 0.01

#: Extension of the strengths below the minimum of a fault to reach a band, as a difference of natural
#: logarithms.
_EXTENSION_BELOW = 3.0

#: Extension of the strengths above the maximum of a gain fault, as a difference of natural logarithms.
_EXTENSION_ABOVE = 1.5

#: Largest number of bisection steps of the strength until the misfit is in the band.
_MAX_BISECTIONS = 14

#: Largest number of draws of a fault's form and its random values.
_MAX_DRAWS = 5

#: Largest number of records that are drawn.
_MAX_RECORDS = 10

#: Static gain of a closed loop.
_LOOP_GAIN = 0.7

#: Iterations of the closed loop.
_LOOP_ITERATIONS = 12


@dataclass(frozen=True, slots=True, eq=False)
class FaultyRecord:
    """A record with injected faults.

    Attributes
    ----------
    record : Dataset
        Inputs (input, temperature, neighbour) and output.
    misfit : float
        RMS of the change of the output caused by the faults over the visible part, in standard deviations of
        the noise. For gains and parameters, only the part that remains when the parameters are adjusted
        within their tolerances. Without tolerances, the part of any fault that remains after an unrestricted
        adjustment.
    sigma : float
        Standard deviation of the noise in the unit of the output.
    nominal : ndarray, shape (samples,)
        Output of the plant with nominal parameters and without faults.
    """

    record: Dataset
    misfit: float
    sigma: float
    nominal: Signal


def inject(
    names: Sequence[str],
    rng: np.random.Generator,
    seconds: float | None = None,
    noise: str = "white",
    band: tuple[float, float] | None = None,
    variant: bool = False,
    system: Rig = PIEZO,
    perturbed: bool = True,
    free: bool = False,
) -> FaultyRecord:
    """Simulate a record with injected faults.

    Parameters
    ----------
    names : sequence of str
        Names of faults of the system, known and unknown; empty for a clean record.
    rng : Generator
    seconds : float, optional
        Length of the record; the default of the system if not given.
    noise : str
        Kind of the measurement noise, an entry of `NOISES`.
    band : tuple of float, optional
        Bounds of the misfit of each fault alone, in standard deviations of the noise.
    variant : bool
        Whether to use the non-standard forms of faults that have them.
    system : Rig
    perturbed : bool
        Whether the parameters of the plant deviate from the nominal ones within the tolerances. If not, as
        for a simulator that cannot be calibrated, gains and parameters are fully visible.
    free : bool
        Whether the parameters of the simulator have no tolerances. Then the part of a fault that any
        parameters can absorb does not count as misfit.

    Raises
    ------
    ValueError
        No strength of a fault has a misfit within the band, in any of several records.
    """
    faults = {**system.known, **system.unknown}
    for _ in range(_MAX_RECORDS):
        drive = system.excitation(rng, seconds or system.seconds)
        plant = system.plant
        for name, spread in system.relative_error.items() if perturbed else ():
            factor = float(np.exp(spread * rng.standard_normal()))
            plant = alter_parameter(plant, **{name: getattr(plant, name) * factor})
        observer = _Observer(system, drive, plant, free)
        faulty: Plant | None = plant
        for name in names:
            absorbable = free or (perturbed and name in GAIN_FAULTS)
            faulty = faulty and _inject_fault(
                faults[name], absorbable, rng, plant, faulty, observer, band, variant
            )
        if faulty is not None:
            break
    else:
        raise ValueError(f"{' and '.join(names)} cannot be injected with a misfit within {band} sigma")
    y = observer.clean if faulty is plant else observer.simulate(faulty)
    errors = observer.sigma * NOISES[noise](rng, y)
    fed_back = _close_loop(system, faulty, drive, errors) if noise in FED_BACK else drive
    measured = y if fed_back is drive else simulate_plant(faulty, fed_back)[:: system.decimation]
    record = Dataset(
        u=np.column_stack([fed_back.u, drive.temperature, drive.neighbour])[:: system.decimation],
        y=measured + errors,
        dt=system.decimation / drive.rate,
        input_names=(system.input[0], "T_K", system.neighbour[0]),
        input_units=(system.input[1], "K", system.neighbour[1]),
        output_name=system.output[0],
        output_unit=system.output[1],
    )
    after_calibration = bool(names) and (free or (perturbed and bool(set(names) & set(GAIN_FAULTS))))
    misfit = observer.misfit_after_calibration if after_calibration else observer.misfit
    return FaultyRecord(record, misfit(y), observer.sigma, observer.nominal)


class _Observer:
    """Noise-free recorded output of plants, and its misfit to the plant without faults."""

    def __init__(self, system: Rig, drive: Excitation, plant: Plant, free: bool) -> None:
        self._system, self._drive, self._free = system, drive, free
        self.clean = self.simulate(plant)
        self.nominal = self.simulate(system.plant)
        self.sigma = system.noise * drive.peak_output
        self._sensitivities: Signal | None = None

    def simulate(self, plant: Plant) -> Signal:
        """Return the recorded samples of a plant without noise."""
        return simulate_plant(plant, self._drive)[:: self._system.decimation]

    def misfit(self, y: Signal) -> float:
        """Return the RMS deviation from the clean output, in standard deviations of the noise."""
        part = slice(int(VISIBLE_FRACTION * y.size))
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.sqrt(np.mean((y - self.clean)[part] ** 2))) / self.sigma

    def misfit_after_calibration(self, y: Signal) -> float:
        """Return the RMS deviation that remains after calibration, in standard deviations of the noise.

        Calibration adjusts the nominal parameters within their tolerances. The adjustment is linearised. The
        norm of the adjustments of all parameters, in tolerances, is limited to its quantile in clean records.
        """
        part = slice(int(VISIBLE_FRACTION * y.size))
        tolerance = self._system.tolerance
        if self._sensitivities is None:
            self._sensitivities = np.column_stack(
                [self._change_by(name, relative) for name, relative in tolerance.items()]
            )
        sensitivities, deviation = self._sensitivities[part], (y - self.nominal)[part]
        radius = (
            np.inf
            if self._free
            else float(np.sqrt(scipy.stats.chi2.ppf(1.0 - _EXCESS_PROBABILITY, len(tolerance))))
        )
        remaining = deviation - sensitivities @ _solve_within_radius(sensitivities, deviation, radius)
        return float(np.sqrt(np.mean(remaining**2))) / self.sigma

    def _change_by(self, name: str, relative: float) -> Signal:
        """Return the change of the nominal output by a relative change of a parameter."""
        nominal = self._system.plant
        change = {name: getattr(nominal, name) * (1.0 + relative)}
        return self.simulate(alter_parameter(nominal, **change)) - self.nominal


def _solve_within_radius(columns: Signal, target: Signal, radius: float) -> Signal:
    """Solve a least-squares problem under an upper bound of the norm, by ridge regression."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    values = np.maximum(values, 1e-12 * values[-1])
    slope = vectors.T @ (columns.T @ target)

    def excess_norm(ridge: float) -> float:
        return float(np.linalg.norm(slope / (values + ridge))) - radius

    ridge = 0.0
    if excess_norm(0.0) > 0.0:  # never true for an infinite radius
        ridge = scipy.optimize.brentq(excess_norm, 0.0, float(np.linalg.norm(slope)) / radius)
    return vectors @ (slope / (values + ridge))


def _inject_fault(
    fault: Fault,
    absorbable: bool,
    rng: np.random.Generator,
    plant: Plant,
    faulty: Plant,
    observer: _Observer,
    band: tuple[float, float] | None,
    variant: bool,
) -> Plant | None:
    """Add a fault to an already faulty plant; return None if the fault is not visible in this record.

    An example is a saturation that only the held-out part reaches.
    """
    forms = (variant and fault.forms[fault.standard_forms :]) or fault.forms[: fault.standard_forms]
    for _ in range(_MAX_DRAWS):
        form = forms[int(rng.integers(len(forms)))]
        inject_form = _find_strength(fault, form, absorbable, rng, plant, observer, band)
        if inject_form is not None:
            return inject_form(faulty)
    return None


def _find_strength(
    fault: Fault,
    form: Inject,
    absorbable: bool,
    rng: np.random.Generator,
    plant: Plant,
    observer: _Observer,
    band: tuple[float, float] | None,
) -> Callable[[Plant], Plant] | None:
    """Return a function that injects a form with a misfit in the band; None if no strength is found."""
    low, high = np.log(fault.minimum), np.log(fault.maximum)
    logarithm = float(rng.uniform(low, high))
    state = rng.bit_generator.state

    def inject_form(target: Plant) -> Plant:
        # Restore the generator, so that signs, times and frequencies do not change during the bisection.
        rng.bit_generator.state = state
        return form(rng, float(np.exp(logarithm)), target)

    if band is None:
        return inject_form
    measure = observer.misfit_after_calibration if absorbable else observer.misfit
    low, high = low - _EXTENSION_BELOW, high + (_EXTENSION_ABOVE if absorbable else 0.0)
    for _ in range(_MAX_BISECTIONS):
        misfit = measure(observer.simulate(inject_form(plant)))
        if band[0] <= misfit <= band[1]:
            return inject_form
        low, high = (logarithm, high) if misfit < band[0] else (low, logarithm)
        logarithm = (low + high) / 2
    return None


def _close_loop(system: Rig, plant: Plant, drive: Excitation, errors: Signal) -> Excitation:
    """Return the excitation of a plant under feedback of the deviation from its output without noise.

    The controller filters the noisy samples and acts one sample later. A loop gain below 1 makes the
    fixed-point iteration over the whole record converge.
    """
    dt = system.decimation / drive.rate
    decay = np.exp(-dt / system.controller_lag)
    gain = _LOOP_GAIN * drive.peak_input / drive.peak_output
    times = drive.time[:: system.decimation]
    reference = simulate_plant(plant, drive)[:: system.decimation]
    closed = drive
    for _ in range(_LOOP_ITERATIONS):
        deviation = simulate_plant(plant, closed)[:: system.decimation] + errors - reference
        action = scipy.signal.lfilter([0.0, gain * (1.0 - decay)], [1.0, -decay], -deviation)
        closed = replace(drive, u=drive.u + np.interp(drive.time, times, action))
    return closed
