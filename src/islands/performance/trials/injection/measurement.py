"""Records of a truth, as they would have been measured: decimated, and with noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from islands.data.dataset import Dataset
from islands.performance.trials.injection.excitation import Excitation, Signal
from islands.performance.trials.injection.faults import Fault, Inject, alter_parameter
from islands.performance.trials.injection.piezo import PIEZO
from islands.performance.trials.injection.plant import Plant, simulate_plant
from islands.performance.trials.injection.rig import Rig

#: Part of a record in which what is hidden has to be seen: the rest may be locked away.
SEEN = 0.75

#: What calibration takes up: of these only what is left behind it can be seen.
SCALE = ("sensor-gain", "input-gain", "wrong-parameter")

#: Part of all clean records whose parameters are further from their nominal values than what counts as
#: allowed: who calls less a wrong parameter has more false names than that.
_BEYOND = 0.01

#: How far below its least strength an effect may be to come into a band, and a gain above its most, in
#: logarithms; halvings of the interval of strengths until its misfit is there; draws of all else of an
#: effect, and then of the record.
_BELOW, _ABOVE, _TRIES, _DRAWS, _RECORDS = 3.0, 1.5, 14, 5, 10


@dataclass(frozen=True, slots=True, eq=False)
class FaultyRecord:
    """A record with something hidden in it.

    Attributes
    ----------
    record : Dataset
        Input, temperature and neighbour; output.
    misfit : float
        Root mean square of what was hidden, over the part that is not locked away, in the noise's. Of gains
        and parameters: of what is left of them when the parameters are moved as far as tolerances allow; and
        so of all, where nothing is stated of parameters and they may be moved as far as they like.
    sigma : float
        The noise's standard deviation in the output's unit.
    nominal : ndarray, shape (samples,)
        What a system of nominal parameters would have done, with nothing hidden in it.
    """

    record: Dataset
    misfit: float
    sigma: float
    nominal: Signal


def inject(
    names: Sequence[str],
    rng: np.random.Generator,
    seconds: float | None = None,
    pole: float = 0.0,
    band: tuple[float, float] | None = None,
    variant: bool = False,
    system: Rig = PIEZO,
    apart: bool = True,
    free: bool = False,
) -> FaultyRecord:
    """Hide effects, or nothing, in a record.

    Parameters
    ----------
    names : sequence of str
        Of what can be hidden in the system, known and unknown.
    rng : Generator
    seconds : float, optional
        The system's usual length where nothing is said.
    pole : float
        Of the noise's memory of the last sample of the record; 0 is white.
    band : tuple of float, optional
        Between which the misfit of each effect alone has to be, in standard deviations of the noise.
    variant : bool
        In forms unlike the usual ones, where there are others.
    system : Rig
    apart : bool
        The truth's parameters are not the nominal ones, within what tolerances say. Else they are, for a
        simulation that cannot be calibrated: then gains and parameters can be seen in full.
    free : bool
        Nothing is stated of the simulation's parameters: what they can take up is no misfit.

    Raises
    ------
    ValueError
        No strength of an effect has a misfit within the band, in any of several records.
    """
    entries = {**system.known, **system.unknown}
    for _ in range(_RECORDS):
        driven = system.excitation(rng, seconds or system.seconds)
        truth = system.plant
        for name, spread in system.relative_error.items() if apart else ():
            factor = float(np.exp(spread * rng.standard_normal()))
            truth = alter_parameter(truth, **{name: getattr(truth, name) * factor})
        seen = _Seen(system, driven, truth, free)
        affected: Plant | None = truth
        for name in names:
            scale = free or (apart and name in SCALE)
            affected = affected and _hidden(entries[name], scale, rng, truth, affected, seen, band, variant)
        if affected is not None:
            break
    else:
        raise ValueError(f"{' and '.join(names)} cannot be hidden with a misfit within {band} sigma")
    y = seen.clean if affected is truth else seen.of(affected)
    noise = seen.sigma * _noise(rng, y.size, pole)
    record = Dataset(
        u=np.column_stack([driven.u, driven.temperature, driven.neighbour])[:: system.decimation],
        y=y + noise,
        dt=system.decimation / driven.rate,
        input_names=(system.input[0], "T_K", system.neighbour[0]),
        input_units=(system.input[1], "K", system.neighbour[1]),
        output_name=system.output[0],
        output_unit=system.output[1],
    )
    misfit = seen.left if names and (free or (apart and set(names) & set(SCALE))) else seen.misfit
    return FaultyRecord(record, misfit(y), seen.sigma, seen.nominal)


class _Seen:
    """What a record shows of a truth, and how far that is from the truth with nothing hidden in it."""

    def __init__(self, system: Rig, driven: Excitation, truth: Plant, free: bool) -> None:
        self._system, self._driven, self._free = system, driven, free
        self.clean = self.of(truth)
        self.nominal = self.of(system.plant)
        self.sigma = system.noise * driven.output
        self._moved: Signal | None = None

    def of(self, truth: Plant) -> Signal:
        """Return the samples of a truth that are recorded, without noise."""
        return simulate_plant(truth, self._driven)[:: self._system.decimation]

    def misfit(self, y: Signal) -> float:
        """Return the root mean square of what was hidden, in the noise's."""
        part = slice(int(SEEN * y.size))
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.sqrt(np.mean((y - self.clean)[part] ** 2))) / self.sigma

    def left(self, y: Signal) -> float:
        """Return the same, of what is left when the nominal parameters are moved as far as they may be.

        To the first order, and all parameters together: they are as many tolerances off, in the root of the
        sum of squares, as in all but a few clean records.
        """
        part = slice(int(SEEN * y.size))
        tolerance = self._system.tolerance
        if self._moved is None:
            self._moved = np.column_stack([self._by(name, stated) for name, stated in tolerance.items()])
        moved, missed = self._moved[part], (y - self.nominal)[part]
        reach = np.inf if self._free else float(np.sqrt(scipy.stats.chi2.ppf(1.0 - _BEYOND, len(tolerance))))
        left = missed - moved @ _within(moved, missed, reach)
        return float(np.sqrt(np.mean(left**2))) / self.sigma

    def _by(self, name: str, far: float) -> Signal:
        nominal = self._system.plant
        change = {name: getattr(nominal, name) * (1.0 + far)}
        return self.of(alter_parameter(nominal, **change)) - self.nominal


def _within(columns: Signal, target: Signal, reach: float) -> Signal:
    """Return least squares no longer than a reach: the pull to zero is as strong as that takes."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    values = np.maximum(values, 1e-12 * values[-1])
    slope = vectors.T @ (columns.T @ target)

    def far(pull: float) -> float:
        return float(np.linalg.norm(slope / (values + pull))) - reach

    pull = 0.0
    if far(0.0) > 0.0:  # never, of a reach without end
        pull = scipy.optimize.brentq(far, 0.0, float(np.linalg.norm(slope)) / reach)
    return vectors @ (slope / (values + pull))


def _hidden(
    entry: Fault,
    scale: bool,
    rng: np.random.Generator,
    truth: Plant,
    affected: Plant,
    seen: _Seen,
    band: tuple[float, float] | None,
    variant: bool,
) -> Plant | None:
    """Return a truth with an effect hidden in it too; None where that cannot be seen in this record.

    Such as a limit that only the locked part comes near.
    """
    forms = (variant and entry.forms[entry.usual :]) or entry.forms[: entry.usual]
    for _ in range(_DRAWS):
        form = forms[int(rng.integers(len(forms)))]
        hidden = _sought(entry, form, scale, rng, truth, seen, band)
        if hidden is not None:
            return hidden(affected)
    return None


def _sought(
    entry: Fault,
    form: Inject,
    scale: bool,
    rng: np.random.Generator,
    truth: Plant,
    seen: _Seen,
    band: tuple[float, float] | None,
) -> Callable[[Plant], Plant] | None:
    """Return what hides a form with a strength whose misfit is in a band, if there is one."""
    low, high = np.log(entry.minimum), np.log(entry.maximum)
    logarithm = float(rng.uniform(low, high))
    state = rng.bit_generator.state

    def hidden(in_truth: Plant) -> Plant:
        # The same draws each time: signs, instants and frequencies stay as the strength is sought.
        rng.bit_generator.state = state
        return form(rng, float(np.exp(logarithm)), in_truth)

    if band is None:
        return hidden
    measure = seen.left if scale else seen.misfit
    low, high = low - _BELOW, high + (_ABOVE if scale else 0.0)
    for _ in range(_TRIES):
        misfit = measure(seen.of(hidden(truth)))
        if band[0] <= misfit <= band[1]:
            return hidden
        low, high = (logarithm, high) if misfit < band[0] else (low, logarithm)
        logarithm = (low + high) / 2
    return None


def _noise(rng: np.random.Generator, count: int, pole: float) -> Signal:
    white = rng.standard_normal(count + 1000)
    coloured: Signal = scipy.signal.lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)
    return coloured[1000:]
