"""The piezo actuator of the paper's equation (11): a truth, and what can be hidden in it."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from islands.performance.trials.injection import force_faults, signal_faults
from islands.performance.trials.injection.excitation import Excitation, Signal, make_excitation, random_noise
from islands.performance.trials.injection.faults import (
    Fault,
    add_force,
    after_plant,
    ageing,
    before_plant,
    gain_step,
    set_attribute,
    wrong,
)
from islands.performance.trials.injection.plant import Plant
from islands.performance.trials.injection.rig import Rig, fault_table

#: Samples a second of the truth, and the frequency in Hz up to which its input moves.
RATE, BAND = 1000, 1.0

#: Largest input in V, largest output in um, and the usual rate of the input in V/s: what strengths refer to.
PEAK, OUTPUT, SPEED = 40.0, 45.0, 60.0


@dataclass(frozen=True, slots=True)
class Piezo(Plant):
    """A Bouc-Wen actuator; its coordinate is the voltage, and a force adds to the displacement.

    Attributes
    ----------
    A, beta, gamma, dp : float
        As in the paper's equation (11).
    decay : float
        Of the hysteretic state, 1/s.
    hurry : float
        By how much the loop's shape grows with the rate, s/V.
    lean : float
        Asymmetry of the loop, 1/V.
    """

    A: float = 0.9
    beta: float = 0.008
    gamma: float = 0.008
    dp: float = 1.6
    decay: float = 0.0
    hurry: float = 0.0
    lean: float = 0.0

    def equation(self, drive: Excitation, x: Signal) -> Signal:
        """See `Plant`."""
        y = self.dp * x
        if self.gain is not None:
            y = y * self.gain(drive.time)
        return y - np.array(self._hysteresis(x.tolist())) + self._forces(x)

    def _forces(self, x: Signal) -> Signal:
        total = np.zeros_like(x)
        places, rates = (x / PEAK).tolist(), (np.gradient(x) * RATE / SPEED).tolist()
        for force in self.beside:
            strengths, state, last = [], 0.0, places[0]
            for place, rate in zip(places, rates, strict=True):
                # What its own state does between two samples, the force being that of the second.
                state += (place - last) * force(last, place - last, state)[1]
                strengths.append(force(place, rate, state)[0])
                last = place
            total += OUTPUT * np.array(strengths)
        return total

    def _hysteresis(self, x: list[float]) -> list[float]:
        """Integrate the hysteretic state by Heun's method, a millisecond at a time."""
        states, state = [0.0], 0.0

        def slope(h: float, du: float) -> float:
            shape = 1.0 + self.hurry * abs(du) * RATE
            return (
                self.A * du
                - shape * (self.beta * abs(du) * h + self.gamma * du * abs(h))
                - self.decay * h / RATE
                - self.lean * abs(du) * abs(h)
            )

        for here, there in pairwise(x):
            du = there - here
            first = slope(state, du)
            state += (first + slope(state + first, du)) / 2
            states.append(state)
        return states


def _drive(rng: np.random.Generator, seconds: float) -> Excitation:
    """Draw noise through a low-pass; it begins at rest."""
    count = int(seconds * RATE)
    u = random_noise(rng, count, RATE, BAND, BAND) * np.minimum(1.0, np.arange(count) / RATE)
    return make_excitation(rng, PEAK * u / np.max(np.abs(u)), RATE, BAND, PEAK, OUTPUT)


PIEZO = Rig(
    plant=Piezo(),
    relative_error={"A": 0.01, "beta": 0.01, "gamma": 0.01, "dp": 0.005},
    excitation=_drive,
    seconds=60.0,
    decimation=10,
    noise=0.003,
    input=("u_V", "V"),
    output=("y_um", "um"),
    neighbour=("w_V", "V"),
    known=fault_table(
        Fault(
            "delay", 0.002, 0.06, (before_plant(signal_faults.later), before_plant(signal_faults.two_lags))
        ),
        Fault(
            "sensor-lag",
            0.002,
            0.08,
            (after_plant(signal_faults.sensor), after_plant(signal_faults.averaging)),
        ),
        Fault("resonance", 1 / 25, 1 / 4, (after_plant(signal_faults.mode),)),
        Fault("viscous", 0.001, 0.06, (add_force(force_faults.viscous),)),
        Fault("clock-skew", 5e-5, 2e-3, (before_plant(signal_faults.clock),)),
        Fault("sensor-gain", 0.005, 0.1, (after_plant(signal_faults.sensor_gain),)),
        Fault("input-gain", 0.005, 0.1, (before_plant(signal_faults.sensor_gain),)),
        Fault("wrong-parameter", 0.02, 0.6, tuple(map(wrong, ("A", "beta", "gamma", "dp"))), usual=4),
        Fault("offset", 0.001, 0.05, (after_plant(signal_faults.zero),)),
        Fault("linear-drift", 0.002, 0.1, (after_plant(signal_faults.drift),)),
        Fault("jump", 0.002, 0.1, (after_plant(signal_faults.jump),)),
        Fault(
            "thermal-drift",
            0.002,
            0.1,
            (after_plant(signal_faults.thermal), after_plant(signal_faults.slow_thermal)),
        ),
        Fault("exponential-creep", 0.005, 0.15, (after_plant(signal_faults.creep(1.0, 15.0)),)),
        Fault("logarithmic-creep", 0.002, 0.03, (after_plant(signal_faults.log_creep),)),
        Fault("relaxation", 0.02, 1.0, (set_attribute("decay", signed=False),)),
        Fault("rate-dependent-loop", 0.02, 0.4, (set_attribute("hurry", per=SPEED),)),
        Fault("loop-asymmetry", 1e-4, 4e-3, (set_attribute("lean"),)),
        Fault("second-hysteresis", 0.02, 0.15, (add_force(force_faults.parallel),)),
        Fault("backlash", 0.1, 5.0, (before_plant(signal_faults.play),)),
        Fault("stiction", 0.3, 5.0, (before_plant(signal_faults.stick),)),
        Fault(
            "coulomb-friction",
            0.002,
            0.05,
            (add_force(force_faults.coulomb), add_force(force_faults.stribeck)),
        ),
        Fault("viscous-asymmetry", 0.001, 0.06, (add_force(force_faults.one_sided),)),
        Fault("quadratic-drag", 0.001, 0.06, (add_force(force_faults.drag),)),
        Fault("even-nonlinearity", 0.002, 0.1, (add_force(force_faults.square),)),
        Fault("cubic-stiffness", 0.004, 0.2, (add_force(force_faults.cube),)),
        Fault("input-saturation", 0.04, 0.4, (before_plant(signal_faults.cut_input),)),
        Fault("output-saturation", 0.03, 0.35, (after_plant(signal_faults.cut_output),)),
        Fault("dead-zone", 0.1, 5.0, (before_plant(signal_faults.dead),)),
        Fault("absolute-value-sensor", 0.004, 0.1, (after_plant(signal_faults.kink),)),
        Fault("gain-step", 0.005, 0.15, (gain_step,)),
        Fault("ageing", 0.005, 0.15, (ageing,)),
        Fault("periodic-disturbance", 5e-4, 0.03, (after_plant(signal_faults.hum(2.0, 45.0)),)),
        Fault("cross-coupling", 0.002, 0.1, (after_plant(signal_faults.coupling),)),
    ),
    unknown={
        "slew-rate": Fault("", 40.0, 90.0, (before_plant(signal_faults.slew),)),
        "ripple": Fault("", 0.003, 0.03, (after_plant(signal_faults.ripple(3.0, 8.0)),)),
    },
)
