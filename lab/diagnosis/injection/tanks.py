"""Cascaded tanks (a pump fills the upper tank, which drains into the lower one) and their faults."""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from lab.diagnosis.injection import signal_faults
from lab.diagnosis.injection.excitation import (
    Excitation,
    Signal,
    make_excitation,
    multisine,
    random_noise,
    random_sign,
)
from lab.diagnosis.injection.faults import (
    NAMELESS_MAPS,
    Fault,
    Inject,
    after_plant,
    ageing,
    alter_parameter,
    before_plant,
    gain_step,
)
from lab.diagnosis.injection.plant import Plant
from lab.diagnosis.injection.rig import Rig, fault_table

#: Sampling rate of the plant in Hz.
RATE = 2.5

#: Highest frequency of the pump's voltage in Hz.
BAND = 0.004

#: Largest voltage of the pump in V; fault strengths refer to it.
PEAK = 5.0

#: Typical highest level in V of the sensor; fault strengths refer to it.
OUTPUT = 8.0

#: Coefficient of a linear outflow in 1/s that equals the outflow of Torricelli's law at half the typical
#: level.
_LINEAR_OUTFLOW = 0.025

#: Inflow of the pump in V/s at its largest voltage.
_MAX_INFLOW = 0.2


@dataclass(frozen=True, slots=True)
class Tanks(Plant):
    """``x1' = k4 u - k1 sqrt(x1)``, ``x2' = k1 sqrt(x1) - k3 sqrt(x2)``, ``y = x2``; levels in V.

    Attributes
    ----------
    k1, k3, k4 : float
    start : tuple of float
        Levels of the upper and the lower tank at the first sample. The upper level is not measured.
    overflow_depths : tuple of float
        Distance of each tank's edge from the highest level without overflow, relative to this level; 0 means
        that the tank does not overflow.
    spill_fraction : float
        Fraction of the overflow of the upper tank that falls into the lower one.
    leaks : tuple of float
        Coefficients of linear outflows, 1/s.
    exponent : float
        Exponent of the outflow law of both tanks.
    inflows : tuple of float
        Additional inflows into each tank, V/s.
    """

    k1: float = 0.05
    k3: float = 0.05
    k4: float = 0.04
    start: tuple[float, float] = (5.0, 5.0)
    overflow_depths: tuple[float, float] = (0.0, 0.0)
    spill_fraction: float = 0.0
    leaks: tuple[float, float] = (0.0, 0.0)
    exponent: float = 0.5
    inflows: tuple[float, float] = (0.0, 0.0)

    def equation(self, drive: Excitation, x: Signal) -> Signal:
        """Return the lower level in V for a pump voltage x."""
        pumped = self.k4 * (x if self.gain_profile is None else x * self.gain_profile(drive.time))
        midpoints = ((pumped[1:] + pumped[:-1]) / 2).tolist()
        upper, lower = self._integrate_levels(midpoints, (inf, inf))
        if any(self.overflow_depths):
            edges = [
                max(levels) * (1.0 - depth)
                for levels, depth in zip((upper, lower), self.overflow_depths, strict=True)
            ]
            upper, lower = self._integrate_levels(midpoints, (edges[0], edges[1]))
        return np.array(lower)

    def _integrate_levels(
        self, pumped: list[float], edges: tuple[float, float]
    ) -> tuple[list[float], list[float]]:
        """Integrate both levels by Heun's method. The overflow is removed at the end of each step."""
        h = 1.0 / RATE
        (upper_edge, lower_edge), (upper, lower) = edges, self.start
        (upper_leak, lower_leak), (upper_inflow, lower_inflow) = self.leaks, self.inflows
        power = self.exponent

        def slopes(upper: float, lower: float, inflow: float) -> tuple[float, float]:
            upper, lower = max(upper, 0.0), max(lower, 0.0)
            # sqrt is four times as fast as a power of one half.
            drained = self.k1 * (sqrt(upper) if power == 0.5 else upper**power) + upper_leak * upper
            outflow = self.k3 * (sqrt(lower) if power == 0.5 else lower**power) + lower_leak * lower
            return inflow + upper_inflow - drained, drained + lower_inflow - outflow

        upper_levels, lower_levels = [upper], [lower]
        for inflow in pumped:
            upper_slope, lower_slope = slopes(upper, lower, inflow)
            upper_next, lower_next = slopes(upper + h * upper_slope, lower + h * lower_slope, inflow)
            upper, lower = (
                upper + h * (upper_slope + upper_next) / 2,
                lower + h * (lower_slope + lower_next) / 2,
            )
            if upper > upper_edge:
                upper, lower = upper_edge, lower + self.spill_fraction * (upper - upper_edge)
            lower = min(lower, lower_edge)
            upper_levels.append(upper)
            lower_levels.append(lower)
        return upper_levels, lower_levels


def _upper_overflow(rng: np.random.Generator, strength: float, plant: Plant) -> Plant:
    """Let the upper tank overflow; a random part of the overflow falls into the lower tank."""
    return alter_parameter(
        plant, overflow_depths=(strength, 0.0), spill_fraction=float(rng.uniform(0.1, 0.9))
    )


def _lower_overflow(_rng: np.random.Generator, strength: float, plant: Plant) -> Plant:
    """Let the lower tank overflow."""
    return alter_parameter(plant, overflow_depths=(0.0, strength))


def _linear_outflow(upper: float, lower: float) -> Inject:
    """Add linear outflows to the tanks, weighted by ``upper`` and ``lower``."""
    return lambda _rng, strength, plant: alter_parameter(
        plant, leaks=(upper * strength * _LINEAR_OUTFLOW, lower * strength * _LINEAR_OUTFLOW)
    )


def _additional_inflow(upper: float, lower: float) -> Inject:
    """Add constant inflows to the tanks, weighted by ``upper`` and ``lower``."""

    def inject(rng: np.random.Generator, strength: float, plant: Plant) -> Plant:
        c = random_sign(rng) * strength * _MAX_INFLOW
        return alter_parameter(plant, inflows=(upper * c, lower * c))

    return inject


def _outflow_exponent(rng: np.random.Generator, strength: float, plant: Plant) -> Plant:
    """Change the exponent of the outflow law."""
    return alter_parameter(plant, exponent=0.5 * (1.0 + random_sign(rng) * strength))


def _draw_excitation(rng: np.random.Generator, seconds: float) -> Excitation:
    """Draw a random multisine or low-pass noise around a mean voltage."""
    count = int(seconds * RATE)
    spread = (
        random_noise(rng, count, RATE, BAND, BAND) if rng.integers(2) else multisine(rng, count, RATE, BAND)
    )
    u = 0.56 * PEAK + 0.44 * PEAK * spread / np.max(np.abs(spread))
    return make_excitation(rng, u, RATE, BAND, PEAK, OUTPUT)


TANKS = Rig(
    plant=Tanks(),
    relative_error={"k1": 0.02, "k3": 0.02, "k4": 0.02},
    excitation=_draw_excitation,
    seconds=4096.0,
    decimation=10,
    controller_lag=20.0,
    noise=0.003,
    input=("u_V", "V"),
    output=("y_V", "V"),
    neighbour=("w_V", "V"),
    known=fault_table(
        Fault("state-clip", 0.02, 0.6, (_upper_overflow, _lower_overflow), standard_forms=2),
        Fault(
            "outflow-law",
            0.002,
            0.5,
            (_linear_outflow(0.0, 1.0), _linear_outflow(1.0, 0.0), _outflow_exponent),
            standard_forms=2,
        ),
        Fault(
            "input-offset",
            0.001,
            0.2,
            (_additional_inflow(1.0, 0.0), _additional_inflow(0.0, 1.0)),
            standard_forms=2,
        ),
        Fault("delay", 1.0, 40.0, (before_plant(signal_faults.delay), before_plant(signal_faults.two_lags))),
        Fault(
            "sensor-lag",
            1.0,
            40.0,
            (after_plant(signal_faults.sensor_lag), after_plant(signal_faults.moving_average)),
        ),
        Fault("offset", 0.005, 0.1, (after_plant(signal_faults.offset),)),
        Fault("linear-drift", 0.005, 0.2, (after_plant(signal_faults.linear_drift),)),
        Fault("jump", 0.005, 0.2, (after_plant(signal_faults.jump),)),
        Fault("thermal-drift", 0.005, 0.2, (after_plant(signal_faults.thermal_drift),)),
        Fault("cyclic-error", 0.003, 0.03, (after_plant(signal_faults.cyclic_error(0.2, 0.6)),)),
        Fault("output-saturation", 0.03, 0.5, (after_plant(signal_faults.output_saturation),)),
        Fault("input-saturation", 0.03, 0.5, (before_plant(signal_faults.input_saturation),)),
        Fault("rate-limit", 0.4, 5.0, (before_plant(signal_faults.rate_limit),)),
        Fault("gain-step", 0.01, 0.2, (gain_step,)),
        Fault("ageing", 0.01, 0.2, (ageing,)),
        Fault(
            "periodic-disturbance",
            0.002,
            0.05,
            (after_plant(signal_faults.periodic_disturbance(0.006, 0.1)),),
        ),
        Fault("cross-coupling", 0.005, 0.2, (after_plant(signal_faults.cross_coupling),)),
    ),
    unknown={
        **NAMELESS_MAPS,
        "uneven-lag": Fault("", 0.5, 40.0, (before_plant(signal_faults.uneven_lag),)),
    },
)
