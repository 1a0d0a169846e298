"""Piezo actuator of the paper's equation (11), and its faults."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lab.diagnosis.injection import force_faults, signal_faults
from lab.diagnosis.injection.excitation import (
    Excitation,
    Signal,
    make_excitation,
    random_noise,
)
from lab.diagnosis.injection.faults import (
    NAMELESS_FORCES,
    NAMELESS_MAPS,
    Fault,
    add_force,
    after_plant,
    ageing,
    before_plant,
    gain_step,
    scale_parameter,
    set_attribute,
)
from lab.diagnosis.injection.plant import Plant
from lab.diagnosis.injection.rig import Rig, fault_table

#: Sampling rate of the plant in Hz.
RATE = 1000

#: Highest frequency of the input in Hz.
BAND = 1.0

#: Largest input in V; fault strengths refer to it.
PEAK = 40.0

#: Largest output in um; fault strengths refer to it.
OUTPUT = 45.0

#: Typical rate of the input in V/s; fault strengths refer to it.
SPEED = 60.0


@dataclass(frozen=True, slots=True)
class Piezo(Plant):
    """Bouc-Wen actuator. Its coordinate is the voltage; forces are added to the displacement.

    Attributes
    ----------
    A, beta, gamma, dp : float
        Parameters of the paper's equation (11).
    decay : float
        Relaxation rate of the hysteretic state, 1/s.
    rate_dependence : float
        Relative increase of beta and gamma with the rate of the input, s/V.
    asymmetry : float
        Asymmetry of the loop, 1/V.
    """

    A: float = 0.9
    beta: float = 0.008
    gamma: float = 0.008
    dp: float = 1.6
    decay: float = 0.0
    rate_dependence: float = 0.0
    asymmetry: float = 0.0

    def equation(self, drive: Excitation, x: Signal) -> Signal:
        """Return the displacement in um for a voltage x."""
        y = self.dp * x
        if self.gain_profile is not None:
            y = y * self.gain_profile(drive.time)
        return y - np.array(self._integrate_hysteresis(x.tolist())) + self._sum_forces(x)

    def _sum_forces(self, x: Signal) -> Signal:
        total = np.zeros_like(x)
        positions, rates = (x / PEAK).tolist(), (np.gradient(x) * RATE / SPEED).tolist()
        for force in self.forces:
            strengths, state, last = [], 0.0, positions[0]
            for position, rate in zip(positions, rates, strict=True):
                # An explicit Euler step of the state between the samples, then the force at the second
                # sample.
                state += (position - last) * force(last, position - last, state)[1]
                strengths.append(force(position, rate, state)[0])
                last = position
            total += OUTPUT * np.array(strengths)
        return total

    def _integrate_hysteresis(self, x: list[float]) -> list[float]:
        """Integrate the hysteretic state by Heun's method with a step of one sample (1 ms)."""
        states, state = [0.0], 0.0

        def slope(h: float, du: float) -> float:
            shape = 1.0 + self.rate_dependence * abs(du) * RATE
            return (
                self.A * du
                - shape * (self.beta * abs(du) * h + self.gamma * du * abs(h))
                - self.decay * h / RATE
                - self.asymmetry * abs(du) * abs(h)
            )

        for current, following in pairwise(x):
            du = following - current
            first = slope(state, du)
            state += (first + slope(state + first, du)) / 2
            states.append(state)
        return states


def _draw_excitation(rng: np.random.Generator, seconds: float) -> Excitation:
    """Draw low-pass noise with a ramp of one second from rest."""
    count = int(seconds * RATE)
    u = random_noise(rng, count, RATE, BAND, BAND) * np.minimum(1.0, np.arange(count) / RATE)
    return make_excitation(rng, PEAK * u / np.max(np.abs(u)), RATE, BAND, PEAK, OUTPUT)


PIEZO = Rig(
    plant=Piezo(),
    relative_error={"A": 0.01, "beta": 0.01, "gamma": 0.01, "dp": 0.005},
    excitation=_draw_excitation,
    seconds=60.0,
    decimation=10,
    controller_lag=0.1,
    noise=0.003,
    input=("u_V", "V"),
    output=("y_um", "um"),
    neighbour=("w_V", "V"),
    known=fault_table(
        Fault(
            "delay", 0.002, 0.06, (before_plant(signal_faults.delay), before_plant(signal_faults.two_lags))
        ),
        Fault(
            "sensor-lag",
            0.002,
            0.08,
            (after_plant(signal_faults.sensor_lag), after_plant(signal_faults.moving_average)),
        ),
        Fault("resonance", 1 / 25, 1 / 4, (after_plant(signal_faults.resonance),)),
        Fault("viscous", 0.001, 0.06, (add_force(force_faults.viscous),)),
        Fault("clock-skew", 5e-5, 2e-3, (before_plant(signal_faults.clock_skew),)),
        Fault("sensor-gain", 0.005, 0.1, (after_plant(signal_faults.gain_error),)),
        Fault("input-gain", 0.005, 0.1, (before_plant(signal_faults.gain_error),)),
        Fault(
            "wrong-parameter",
            0.02,
            0.6,
            tuple(map(scale_parameter, ("A", "beta", "gamma", "dp"))),
            standard_forms=4,
        ),
        Fault("offset", 0.001, 0.05, (after_plant(signal_faults.offset),)),
        Fault("linear-drift", 0.002, 0.1, (after_plant(signal_faults.linear_drift),)),
        Fault("jump", 0.002, 0.1, (after_plant(signal_faults.jump),)),
        Fault(
            "thermal-drift",
            0.002,
            0.1,
            (after_plant(signal_faults.thermal_drift), after_plant(signal_faults.lagged_thermal_drift)),
        ),
        Fault("exponential-creep", 0.005, 0.15, (after_plant(signal_faults.exponential_creep(1.0, 15.0)),)),
        Fault("logarithmic-creep", 0.002, 0.03, (after_plant(signal_faults.logarithmic_creep),)),
        Fault("relaxation", 0.02, 1.0, (set_attribute("decay", signed=False),)),
        Fault("rate-dependent-loop", 0.02, 0.4, (set_attribute("rate_dependence", per=SPEED),)),
        Fault("loop-asymmetry", 1e-4, 4e-3, (set_attribute("asymmetry"),)),
        Fault("second-hysteresis", 0.02, 0.15, (add_force(force_faults.parallel),)),
        Fault("backlash", 0.1, 5.0, (before_plant(signal_faults.backlash),)),
        Fault("stiction", 0.3, 5.0, (before_plant(signal_faults.stiction),)),
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
        Fault("input-saturation", 0.04, 0.4, (before_plant(signal_faults.input_saturation),)),
        Fault("rate-limit", 0.4, 5.0, (before_plant(signal_faults.rate_limit),)),
        Fault("quantised-input", 1.0, 20.0, (before_plant(signal_faults.quantise),)),
        Fault("cyclic-error", 0.003, 0.03, (after_plant(signal_faults.cyclic_error(2.0, 4.0)),)),
        Fault("output-saturation", 0.03, 0.35, (after_plant(signal_faults.output_saturation),)),
        Fault("dead-zone", 0.1, 5.0, (before_plant(signal_faults.dead_zone),)),
        Fault("absolute-value-sensor", 0.004, 0.1, (after_plant(signal_faults.sign_dependent_gain),)),
        Fault("gain-step", 0.005, 0.15, (gain_step,)),
        Fault("ageing", 0.005, 0.15, (ageing,)),
        Fault(
            "periodic-disturbance", 5e-4, 0.03, (after_plant(signal_faults.periodic_disturbance(2.0, 45.0)),)
        ),
        Fault("cross-coupling", 0.002, 0.1, (after_plant(signal_faults.cross_coupling),)),
    ),
    unknown={
        **NAMELESS_FORCES,
        **NAMELESS_MAPS,
        "uneven-lag": Fault("", 5e-4, 0.06, (before_plant(signal_faults.uneven_lag),)),
    },
)
