"""Records of a truth, as they would have been measured: decimated, and with noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from islands.data.dataset import Dataset
from islands.trials.hide.excitation import DECIMATION, OUTPUT, RATE, Drive, Signal, drive
from islands.trials.hide.forms import KNOWN, UNKNOWN
from islands.trials.hide.truth import Truth, respond

#: Noise relative to the largest output, and how far the truth's parameters are from their nominal values: the
#: tolerances that whoever made the simulation would state.
NOISE = 0.003
SPREAD = {"A": 0.01, "beta": 0.01, "gamma": 0.01, "dp": 0.005}

#: Part of a record in which what is hidden has to be seen: the rest may be locked away.
SEEN = 0.75

#: How far below its least strength an effect may be to come into a band, in logarithms, and halvings of the
#: interval of strengths until its misfit is there.
_BELOW, _TRIES = 3.0, 14


@dataclass(frozen=True, slots=True, eq=False)
class Hiding:
    """A record with something hidden in it.

    Attributes
    ----------
    record : Dataset
        Voltage, temperature and neighbour; displacement.
    misfit : float
        Root mean square of what was hidden, over the part that is not locked away, in the noise's.
    sigma : float
        The noise's standard deviation in um.
    """

    record: Dataset
    misfit: float
    sigma: float


def hide(
    names: Sequence[str],
    rng: np.random.Generator,
    seconds: float = 60.0,
    pole: float = 0.0,
    band: tuple[float, float] | None = None,
    variant: bool = False,
) -> Hiding:
    """Hide effects, or nothing, in a record.

    Parameters
    ----------
    names : sequence of str
        Of `KNOWN` and `UNKNOWN`.
    rng : Generator
    seconds : float
    pole : float
        Of the noise's memory of the last sample of the record; 0 is white.
    band : tuple of float, optional
        Between which the misfit of each effect alone has to be, in standard deviations of the noise.
    variant : bool
        In forms unlike the usual ones, where there are others.
    """
    driven = drive(rng, seconds)
    truth = Truth()
    for name, spread in SPREAD.items():
        factor = float(np.exp(spread * rng.standard_normal()))
        truth = replace(truth, **{name: getattr(truth, name) * factor})
    clean = respond(truth, driven)[::DECIMATION]
    sigma = NOISE * OUTPUT
    affected = truth
    for name in names:
        affected = _hidden(name, rng, truth, affected, driven, clean, sigma, band, variant)
    y = clean if affected is truth else respond(affected, driven)[::DECIMATION]
    noise = sigma * _noise(rng, y.size, pole)
    record = Dataset(
        u=np.column_stack([driven.u, driven.temperature, driven.neighbour])[::DECIMATION],
        y=y + noise,
        dt=DECIMATION / RATE,
        input_names=("u_V", "T_K", "w_V"),
        input_units=("V", "K", "V"),
        output_name="y_um",
        output_unit="um",
    )
    return Hiding(record, _misfit(y - clean) / sigma, sigma)


def _hidden(
    name: str,
    rng: np.random.Generator,
    truth: Truth,
    affected: Truth,
    driven: Drive,
    clean: Signal,
    sigma: float,
    band: tuple[float, float] | None,
    variant: bool,
) -> Truth:
    entry = {**KNOWN, **UNKNOWN}[name]
    forms = entry.forms if name == "wrong-parameter" else entry.forms[1:] if variant else entry.forms[:1]
    form = forms[int(rng.integers(len(forms)))] if forms else entry.forms[0]
    low, high = np.log(entry.least), np.log(entry.most)
    logarithm = float(rng.uniform(low, high))
    if band is not None:
        low = low - _BELOW
    state = rng.bit_generator.state

    def hidden(in_truth: Truth) -> Truth:
        # The same draws each time: signs, instants and frequencies stay as the strength is sought.
        rng.bit_generator.state = state
        return form(rng, float(np.exp(logarithm)), in_truth)

    for _ in range(_TRIES if band is not None else 0):
        misfit = _misfit(respond(hidden(truth), driven)[::DECIMATION] - clean) / sigma
        if band[0] <= misfit <= band[1]:  # type: ignore[index]
            break
        low, high = (logarithm, high) if misfit < band[0] else (low, logarithm)  # type: ignore[index]
        logarithm = (low + high) / 2
    else:
        if band is not None:
            raise ValueError(f"{name} has no strength with a misfit within {band} sigma")
    return hidden(affected)


def _misfit(hidden: Signal) -> float:
    return float(np.sqrt(np.mean(hidden[: int(SEEN * hidden.size)] ** 2)))


def _noise(rng: np.random.Generator, count: int, pole: float) -> Signal:
    white = rng.standard_normal(count + 1000)
    coloured: Signal = scipy.signal.lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)
    return coloured[1000:]
