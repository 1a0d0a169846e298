"""The piezo actuator of the paper's equation (11): a truth, and what can be hidden in it."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from islands.trials.injection import force_faults, signal_faults
from islands.trials.injection.excitation import Drive, Signal, driven, noise
from islands.trials.injection.faults import Hidden, ageing, before, behind, beside, gain_step, own, wrong
from islands.trials.injection.plant import Truth
from islands.trials.injection.rig import System, table

#: Samples a second of the truth, and the frequency in Hz up to which its input moves.
RATE, BAND = 1000, 1.0

#: Largest input in V, largest output in um, and the usual rate of the input in V/s: what strengths refer to.
PEAK, OUTPUT, SPEED = 40.0, 45.0, 60.0


@dataclass(frozen=True, slots=True)
class Piezo(Truth):
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

    def equation(self, drive: Drive, x: Signal) -> Signal:
        """See `Truth`."""
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


def _drive(rng: np.random.Generator, seconds: float) -> Drive:
    """Draw noise through a low-pass; it begins at rest."""
    count = int(seconds * RATE)
    u = noise(rng, count, RATE, BAND, BAND) * np.minimum(1.0, np.arange(count) / RATE)
    return driven(rng, PEAK * u / np.max(np.abs(u)), RATE, BAND, PEAK, OUTPUT)


PIEZO = System(
    truth=Piezo(),
    spread={"A": 0.01, "beta": 0.01, "gamma": 0.01, "dp": 0.005},
    drive=_drive,
    seconds=60.0,
    decimation=10,
    noise=0.003,
    input=("u_V", "V"),
    output=("y_um", "um"),
    neighbour=("w_V", "V"),
    known=table(
        Hidden("delay", 0.002, 0.06, (before(signal_faults.later), before(signal_faults.two_lags))),
        Hidden("sensor-lag", 0.002, 0.08, (behind(signal_faults.sensor), behind(signal_faults.averaging))),
        Hidden("resonance", 1 / 25, 1 / 4, (behind(signal_faults.mode),)),
        Hidden("viscous", 0.001, 0.06, (beside(force_faults.viscous),)),
        Hidden("clock-skew", 5e-5, 2e-3, (before(signal_faults.clock),)),
        Hidden("sensor-gain", 0.005, 0.1, (behind(signal_faults.sensor_gain),)),
        Hidden("input-gain", 0.005, 0.1, (before(signal_faults.sensor_gain),)),
        Hidden("wrong-parameter", 0.02, 0.6, tuple(map(wrong, ("A", "beta", "gamma", "dp"))), usual=4),
        Hidden("offset", 0.001, 0.05, (behind(signal_faults.zero),)),
        Hidden("linear-drift", 0.002, 0.1, (behind(signal_faults.drift),)),
        Hidden("jump", 0.002, 0.1, (behind(signal_faults.jump),)),
        Hidden(
            "thermal-drift", 0.002, 0.1, (behind(signal_faults.thermal), behind(signal_faults.slow_thermal))
        ),
        Hidden("exponential-creep", 0.005, 0.15, (behind(signal_faults.creep(1.0, 15.0)),)),
        Hidden("logarithmic-creep", 0.002, 0.03, (behind(signal_faults.log_creep),)),
        Hidden("relaxation", 0.02, 1.0, (own("decay", signed=False),)),
        Hidden("rate-dependent-loop", 0.02, 0.4, (own("hurry", per=SPEED),)),
        Hidden("loop-asymmetry", 1e-4, 4e-3, (own("lean"),)),
        Hidden("second-hysteresis", 0.02, 0.15, (beside(force_faults.parallel),)),
        Hidden("backlash", 0.1, 5.0, (before(signal_faults.play),)),
        Hidden("stiction", 0.3, 5.0, (before(signal_faults.stick),)),
        Hidden(
            "coulomb-friction", 0.002, 0.05, (beside(force_faults.coulomb), beside(force_faults.stribeck))
        ),
        Hidden("viscous-asymmetry", 0.001, 0.06, (beside(force_faults.one_sided),)),
        Hidden("quadratic-drag", 0.001, 0.06, (beside(force_faults.drag),)),
        Hidden("even-nonlinearity", 0.002, 0.1, (beside(force_faults.square),)),
        Hidden("cubic-stiffness", 0.004, 0.2, (beside(force_faults.cube),)),
        Hidden("input-saturation", 0.04, 0.4, (before(signal_faults.cut_input),)),
        Hidden("output-saturation", 0.03, 0.35, (behind(signal_faults.cut_output),)),
        Hidden("dead-zone", 0.1, 5.0, (before(signal_faults.dead),)),
        Hidden("absolute-value-sensor", 0.004, 0.1, (behind(signal_faults.kink),)),
        Hidden("gain-step", 0.005, 0.15, (gain_step,)),
        Hidden("ageing", 0.005, 0.15, (ageing,)),
        Hidden("periodic-disturbance", 5e-4, 0.03, (behind(signal_faults.hum(2.0, 45.0)),)),
        Hidden("cross-coupling", 0.002, 0.1, (behind(signal_faults.coupling),)),
    ),
    unknown={
        "slew-rate": Hidden("", 40.0, 90.0, (before(signal_faults.slew),)),
        "ripple": Hidden("", 0.003, 0.03, (behind(signal_faults.ripple(3.0, 8.0)),)),
    },
)
