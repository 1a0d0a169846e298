"""A mass on a spring and a damper: a truth, and what can be hidden in it."""

from dataclasses import dataclass

import numpy as np
import scipy

from islands.performance.trials.injection import force_faults, signal_faults
from islands.performance.trials.injection.excitation import (
    Excitation,
    Signal,
    make_excitation,
    multisine,
    random_noise,
)
from islands.performance.trials.injection.faults import (
    Fault,
    add_force,
    after_plant,
    ageing,
    before_plant,
    gain_step,
)
from islands.performance.trials.injection.plant import Plant
from islands.performance.trials.injection.rig import Rig, fault_table

#: Samples a second of the truth, and the frequency in Hz up to which the force moves it.
RATE, BAND = 2000, 20.0

#: Largest force in N, largest displacement in mm, and its usual rate in mm/s: what strengths refer to.
PEAK, OUTPUT, SPEED = 20.0, 20.0, 400.0


@dataclass(frozen=True, slots=True)
class Oscillator(Plant):
    """``m x'' + c x' + k x = u``; its coordinate is the displacement, and a force is a part of the spring's.

    Attributes
    ----------
    m, c, k : float
        In N s^2/mm, N s/mm and N/mm: 8 Hz, a tenth of the critical damping.
    """

    m: float = 8e-4
    c: float = 8e-3
    k: float = 2.0

    def equation(self, drive: Excitation, x: Signal) -> Signal:
        """See `Plant`.

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


def _drive(rng: np.random.Generator, seconds: float) -> Excitation:
    """Draw a random multisine, or noise through a low-pass; it begins at rest."""
    count = int(seconds * RATE)
    shaken = bool(rng.integers(2))
    u = random_noise(rng, count, RATE, BAND, 1.0) if shaken else multisine(rng, count, RATE, BAND)
    u = u * np.minimum(1.0, 10 * np.arange(count) / RATE)
    return make_excitation(rng, PEAK * u / np.max(np.abs(u)), RATE, 1.0, PEAK, OUTPUT)


OSCILLATOR = Rig(
    plant=Oscillator(),
    relative_error={"m": 0.01, "c": 0.03, "k": 0.01},
    excitation=_drive,
    seconds=20.0,
    decimation=10,
    noise=0.003,
    input=("F_N", "N"),
    output=("x_mm", "mm"),
    neighbour=("w_V", "V"),
    known=fault_table(
        Fault(
            "delay", 0.0005, 0.01, (before_plant(signal_faults.later), before_plant(signal_faults.two_lags))
        ),
        Fault(
            "sensor-lag",
            0.0005,
            0.01,
            (after_plant(signal_faults.sensor), after_plant(signal_faults.averaging)),
        ),
        Fault("offset", 0.001, 0.05, (after_plant(signal_faults.zero),)),
        Fault("linear-drift", 0.002, 0.1, (after_plant(signal_faults.drift),)),
        Fault("jump", 0.002, 0.1, (after_plant(signal_faults.jump),)),
        Fault(
            "thermal-drift",
            0.002,
            0.1,
            (after_plant(signal_faults.thermal), after_plant(signal_faults.slow_thermal)),
        ),
        Fault("exponential-creep", 0.01, 1.0, (after_plant(signal_faults.creep(0.3, 4.0)),)),
        Fault("second-hysteresis", 0.002, 0.3, (add_force(force_faults.hysteresis),)),
        Fault("backlash", 0.05, 2.5, (before_plant(signal_faults.play),)),
        Fault(
            "coulomb-friction",
            0.001,
            0.05,
            (add_force(force_faults.coulomb), add_force(force_faults.stribeck)),
        ),
        Fault("viscous-asymmetry", 0.002, 0.1, (add_force(force_faults.one_sided),)),
        Fault("quadratic-drag", 0.002, 0.2, (add_force(force_faults.drag),)),
        Fault("even-nonlinearity", 0.002, 0.2, (add_force(force_faults.square),)),
        Fault("cubic-stiffness", 0.004, 0.3, (add_force(force_faults.cube),)),
        Fault("input-saturation", 0.04, 0.5, (before_plant(signal_faults.cut_input),)),
        Fault("output-saturation", 0.03, 0.5, (after_plant(signal_faults.cut_output),)),
        Fault("dead-zone", 0.05, 2.5, (before_plant(signal_faults.dead),)),
        Fault("gain-step", 0.005, 0.15, (gain_step,)),
        Fault("ageing", 0.005, 0.15, (ageing,)),
        Fault("periodic-disturbance", 5e-4, 0.03, (after_plant(signal_faults.hum(25.0, 90.0)),)),
        Fault("cross-coupling", 0.002, 0.1, (after_plant(signal_faults.coupling),)),
    ),
    unknown={
        "slew-rate": Fault("", 150.0, 500.0, (before_plant(signal_faults.slew),)),
        "ripple": Fault("", 0.003, 0.03, (after_plant(signal_faults.ripple(2.0, 5.0)),)),
    },
)
