"""A mass on a spring and a damper: a truth, and what can be hidden in it."""

from dataclasses import dataclass

import numpy as np
import scipy

from islands.trials.injection import force_faults, signal_faults
from islands.trials.injection.excitation import Drive, Signal, driven, multisine, noise
from islands.trials.injection.faults import Hidden, ageing, before, behind, beside, gain_step
from islands.trials.injection.plant import Truth
from islands.trials.injection.rig import System, table

#: Samples a second of the truth, and the frequency in Hz up to which the force moves it.
RATE, BAND = 2000, 20.0

#: Largest force in N, largest displacement in mm, and its usual rate in mm/s: what strengths refer to.
PEAK, OUTPUT, SPEED = 20.0, 20.0, 400.0


@dataclass(frozen=True, slots=True)
class Oscillator(Truth):
    """``m x'' + c x' + k x = u``; its coordinate is the displacement, and a force is a part of the spring's.

    Attributes
    ----------
    m, c, k : float
        In N s^2/mm, N s/mm and N/mm: 8 Hz, a tenth of the critical damping.
    """

    m: float = 8e-4
    c: float = 8e-3
    k: float = 2.0

    def equation(self, drive: Drive, x: Signal) -> Signal:
        """See `Truth`.

        The linear part is solved exactly over a step; the forces are those of its beginning and its end in
        equal parts, as Heun has it.
        """
        force = x if self.gain is None else x * self.gain(drive.time)
        h = 1.0 / RATE
        system = np.array([[0.0, 1.0, 0.0], [-self.k, -self.c, 1.0], [0.0, 0.0, 0.0]])
        system[1] /= self.m
        (xx, xv, xf), (vx, vv, vf), _ = scipy.linalg.expm(h * system).tolist()
        place, speed, states = 0.0, 0.0, [0.0] * len(self.beside)
        places = [place]
        size, hidden = self.k * OUTPUT, self.beside

        def beside(place: float, speed: float, states: list[float]) -> tuple[float, list[float]]:
            total, slopes = 0.0, []
            for each, state in zip(hidden, states, strict=True):
                strength, slope = each(place / OUTPUT, speed / SPEED, state)
                total += size * strength
                slopes.append(slope / OUTPUT)
            return total, slopes

        for u in ((force[1:] + force[:-1]) / 2).tolist():
            ahead, quick, total = xx * place + xv * speed, vx * place + vv * speed, u
            if hidden:
                here, slopes = beside(place, speed, states)
                first = ahead + xf * (u + here)
                moved = [z + each * (first - place) for z, each in zip(states, slopes, strict=True)]
                there, others = beside(first, quick + vf * (u + here), moved)
                total += (here + there) / 2
                step = ahead + xf * total - place
                states = [
                    z + (one + two) / 2 * step for z, one, two in zip(states, slopes, others, strict=True)
                ]
            place, speed = ahead + xf * total, quick + vf * total
            places.append(place)
        return np.array(places)


def _drive(rng: np.random.Generator, seconds: float) -> Drive:
    """Draw a random multisine, or noise through a low-pass; it begins at rest."""
    count = int(seconds * RATE)
    shaken = bool(rng.integers(2))
    u = noise(rng, count, RATE, BAND, 1.0) if shaken else multisine(rng, count, RATE, BAND)
    u = u * np.minimum(1.0, 10 * np.arange(count) / RATE)
    return driven(rng, PEAK * u / np.max(np.abs(u)), RATE, 1.0, PEAK, OUTPUT)


OSCILLATOR = System(
    truth=Oscillator(),
    spread={"m": 0.01, "c": 0.03, "k": 0.01},
    drive=_drive,
    seconds=20.0,
    decimation=10,
    noise=0.003,
    input=("F_N", "N"),
    output=("x_mm", "mm"),
    neighbour=("w_V", "V"),
    known=table(
        Hidden("delay", 0.0005, 0.01, (before(signal_faults.later), before(signal_faults.two_lags))),
        Hidden("sensor-lag", 0.0005, 0.01, (behind(signal_faults.sensor), behind(signal_faults.averaging))),
        Hidden("offset", 0.001, 0.05, (behind(signal_faults.zero),)),
        Hidden("linear-drift", 0.002, 0.1, (behind(signal_faults.drift),)),
        Hidden("jump", 0.002, 0.1, (behind(signal_faults.jump),)),
        Hidden(
            "thermal-drift", 0.002, 0.1, (behind(signal_faults.thermal), behind(signal_faults.slow_thermal))
        ),
        Hidden("exponential-creep", 0.01, 1.0, (behind(signal_faults.creep(0.3, 4.0)),)),
        Hidden("second-hysteresis", 0.002, 0.3, (beside(force_faults.hysteresis),)),
        Hidden("backlash", 0.05, 2.5, (before(signal_faults.play),)),
        Hidden(
            "coulomb-friction", 0.001, 0.05, (beside(force_faults.coulomb), beside(force_faults.stribeck))
        ),
        Hidden("viscous-asymmetry", 0.002, 0.1, (beside(force_faults.one_sided),)),
        Hidden("quadratic-drag", 0.002, 0.2, (beside(force_faults.drag),)),
        Hidden("even-nonlinearity", 0.002, 0.2, (beside(force_faults.square),)),
        Hidden("cubic-stiffness", 0.004, 0.3, (beside(force_faults.cube),)),
        Hidden("input-saturation", 0.04, 0.5, (before(signal_faults.cut_input),)),
        Hidden("output-saturation", 0.03, 0.5, (behind(signal_faults.cut_output),)),
        Hidden("dead-zone", 0.05, 2.5, (before(signal_faults.dead),)),
        Hidden("gain-step", 0.005, 0.15, (gain_step,)),
        Hidden("ageing", 0.005, 0.15, (ageing,)),
        Hidden("periodic-disturbance", 5e-4, 0.03, (behind(signal_faults.hum(25.0, 90.0)),)),
        Hidden("cross-coupling", 0.002, 0.1, (behind(signal_faults.coupling),)),
    ),
    unknown={
        "slew-rate": Hidden("", 150.0, 500.0, (before(signal_faults.slew),)),
        "ripple": Hidden("", 0.003, 0.03, (behind(signal_faults.ripple(2.0, 5.0)),)),
    },
)
