"""Mass-spring-damper oscillator and its faults."""

from dataclasses import dataclass

import numpy as np
import scipy

from lab.diagnosis.injection import force_faults, signal_faults
from lab.diagnosis.injection.excitation import (
    Excitation,
    Signal,
    make_excitation,
    multisine,
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
)
from lab.diagnosis.injection.plant import Plant
from lab.diagnosis.injection.rig import Rig, fault_table

#: Sampling rate of the plant in Hz.
RATE = 2000

#: Highest frequency of the force in Hz.
BAND = 20.0

#: Largest force in N; fault strengths refer to it.
PEAK = 20.0

#: Largest displacement in mm; fault strengths refer to it.
OUTPUT = 20.0

#: Typical speed in mm/s; fault strengths refer to it.
SPEED = 400.0


@dataclass(frozen=True, slots=True)
class Oscillator(Plant):
    """``m x'' + c x' + k x = u``. Its coordinate is the displacement; forces scale with the spring force.

    Attributes
    ----------
    m, c, k : float
        Parameters in N s^2/mm, N s/mm and N/mm. The defaults give 8 Hz and a damping ratio of 0.1.
    """

    m: float = 8e-4
    c: float = 8e-3
    k: float = 2.0

    def equation(self, drive: Excitation, x: Signal) -> Signal:
        """Return the displacement in mm for a force x."""
        # The linear part is solved exactly over each step. The forces are the mean of their values at the
        # beginning and at the predicted end of the step (Heun's method).
        external = x if self.gain_profile is None else x * self.gain_profile(drive.time)
        h = 1.0 / RATE
        system = np.array([[0.0, 1.0, 0.0], [-self.k, -self.c, 1.0], [0.0, 0.0, 0.0]])
        system[1] /= self.m
        (xx, xv, xf), (vx, vv, vf), _ = scipy.linalg.expm(h * system).tolist()
        position, speed, states = 0.0, 0.0, [0.0] * len(self.forces)
        positions = [position]
        spring_force, forces = self.k * OUTPUT, self.forces

        def sum_forces(position: float, speed: float, states: list[float]) -> tuple[float, list[float]]:
            total, slopes = 0.0, []
            for force, state in zip(forces, states, strict=True):
                strength, slope = force(position / OUTPUT, speed / SPEED, state)
                total += spring_force * strength
                slopes.append(slope / OUTPUT)
            return total, slopes

        for u in ((external[1:] + external[:-1]) / 2).tolist():
            free_position, free_speed, total = xx * position + xv * speed, vx * position + vv * speed, u
            if forces:
                start_force, start_slopes = sum_forces(position, speed, states)
                predicted = free_position + xf * (u + start_force)
                predicted_states = [
                    z + slope * (predicted - position) for z, slope in zip(states, start_slopes, strict=True)
                ]
                end_force, end_slopes = sum_forces(
                    predicted, free_speed + vf * (u + start_force), predicted_states
                )
                total += (start_force + end_force) / 2
                step = free_position + xf * total - position
                states = [
                    z + (start + end) / 2 * step
                    for z, start, end in zip(states, start_slopes, end_slopes, strict=True)
                ]
            position, speed = free_position + xf * total, free_speed + vf * total
            positions.append(position)
        return np.array(positions)


def _draw_excitation(rng: np.random.Generator, seconds: float) -> Excitation:
    """Draw a random multisine or low-pass noise with a ramp of 0.1 s from rest."""
    count = int(seconds * RATE)
    use_noise = bool(rng.integers(2))
    u = random_noise(rng, count, RATE, BAND, 1.0) if use_noise else multisine(rng, count, RATE, BAND)
    u = u * np.minimum(1.0, 10 * np.arange(count) / RATE)
    return make_excitation(rng, PEAK * u / np.max(np.abs(u)), RATE, 1.0, PEAK, OUTPUT)


OSCILLATOR = Rig(
    plant=Oscillator(),
    relative_error={"m": 0.01, "c": 0.03, "k": 0.01},
    excitation=_draw_excitation,
    seconds=20.0,
    decimation=10,
    controller_lag=0.2,
    noise=0.003,
    input=("F_N", "N"),
    output=("x_mm", "mm"),
    neighbour=("w_V", "V"),
    known=fault_table(
        Fault(
            "delay", 0.0005, 0.01, (before_plant(signal_faults.delay), before_plant(signal_faults.two_lags))
        ),
        Fault(
            "sensor-lag",
            0.0005,
            0.01,
            (after_plant(signal_faults.sensor_lag), after_plant(signal_faults.moving_average)),
        ),
        Fault("varying-delay", 0.0005, 0.01, (before_plant(signal_faults.varying_delay),)),
        Fault("growing-lag", 0.0005, 0.01, (after_plant(signal_faults.growing_lag),)),
        Fault("sensor-hysteresis", 0.002, 0.1, (after_plant(signal_faults.sensor_hysteresis),)),
        Fault("offset", 0.001, 0.05, (after_plant(signal_faults.offset),)),
        Fault("linear-drift", 0.002, 0.1, (after_plant(signal_faults.linear_drift),)),
        Fault("jump", 0.002, 0.1, (after_plant(signal_faults.jump),)),
        Fault(
            "thermal-drift",
            0.002,
            0.1,
            (after_plant(signal_faults.thermal_drift), after_plant(signal_faults.lagged_thermal_drift)),
        ),
        Fault("exponential-creep", 0.01, 1.0, (after_plant(signal_faults.exponential_creep(0.3, 4.0)),)),
        Fault("second-hysteresis", 0.002, 0.3, (add_force(force_faults.hysteresis),)),
        Fault("second-input", 0.002, 0.3, (before_plant(signal_faults.second_input),)),
        Fault("temperature-gain", 0.005, 0.5, (before_plant(signal_faults.temperature_gain),)),
        Fault("backlash", 0.05, 2.5, (before_plant(signal_faults.backlash),)),
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
        Fault("cogging", 0.002, 0.2, (add_force(force_faults.cogging),)),
        Fault("input-saturation", 0.04, 0.5, (before_plant(signal_faults.input_saturation),)),
        Fault("rate-limit", 0.4, 5.0, (before_plant(signal_faults.rate_limit),)),
        Fault("quantised-input", 0.5, 8.0, (before_plant(signal_faults.quantise),)),
        Fault("cyclic-error", 0.003, 0.03, (after_plant(signal_faults.cyclic_error(1.0, 3.0)),)),
        Fault("output-saturation", 0.03, 0.5, (after_plant(signal_faults.output_saturation),)),
        Fault("dead-zone", 0.05, 2.5, (before_plant(signal_faults.dead_zone),)),
        Fault("gain-step", 0.005, 0.15, (gain_step,)),
        Fault("ageing", 0.005, 0.15, (ageing,)),
        Fault(
            "periodic-disturbance", 5e-4, 0.03, (after_plant(signal_faults.periodic_disturbance(25.0, 90.0)),)
        ),
        Fault("swept-disturbance", 0.002, 0.3, (before_plant(signal_faults.swept_disturbance(1.0, 20.0)),)),
        Fault("swept-interference", 5e-4, 0.03, (after_plant(signal_faults.swept_interference(1.0, 90.0)),)),
        Fault("cross-coupling", 0.002, 0.1, (after_plant(signal_faults.cross_coupling),)),
    ),
    unknown={
        **NAMELESS_FORCES,
        **NAMELESS_MAPS,
        "uneven-lag": Fault("", 2e-4, 0.01, (before_plant(signal_faults.uneven_lag),)),
    },
)
