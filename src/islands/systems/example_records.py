"""Records of the examples of the documentation: a piezo actuator, a motor, a heated pipe and two tanks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from islands.records.channel_names import parse_unit
from islands.records.dataset import Dataset

#: Digits behind the decimal point, as a logger would write them.
_DECIMALS = 4


@dataclass(frozen=True, slots=True)
class ExampleRecord:
    """Record of an example.

    Attributes
    ----------
    description : str
        One line: the system and what is special about it.
    make : callable
        Return the record, the same at every call.
    """

    description: str
    make: Callable[[], Dataset]


def _measure(
    u: NDArray[np.float64], y: NDArray[np.float64], noise: float, dt: float, names: tuple[str, str]
) -> Dataset:
    """Return a record with white noise of the sensor, rounded to the digits of a logger."""
    y = y + noise * np.random.default_rng(0).standard_normal(len(y))
    units = [parse_unit(name) for name in names]
    return Dataset(u.round(_DECIMALS), y.round(_DECIMALS), dt, (names[0],), names[1], (units[0],), units[1])


def _make_steps(lowest: float, highest: float, steps: int, samples: int, seed: int) -> NDArray[np.float64]:
    return np.repeat(np.random.default_rng(seed).uniform(lowest, highest, steps), samples)


def make_piezo() -> Dataset:
    """Bouc-Wen model of a piezo actuator, equation (11), driven by four sines for 30 s."""
    time = 0.01 * np.arange(3000)
    sines = ((20, 0.31, 1), (12, 0.83, 2), (8, 1.37, 3), (5, 2.1, 4))
    u = sum(size * np.sin(2 * np.pi * frequency * time + phase) for size, frequency, phase in sines)
    h = np.zeros(len(time))
    for k in range(1, len(time)):
        h[k], change = h[k - 1], (u[k] - u[k - 1]) / 20
        for _ in range(20):
            h[k] += 0.9 * change - 0.008 * abs(change) * h[k] - 0.008 * change * abs(h[k])
    return _measure(np.asarray(u), 1.6 * u - h, 0.02, 0.01, ("u_V", "y_um"))


def make_motor() -> Dataset:
    """Speed of a motor with Coulomb friction, driven by steps of the voltage for 60 s."""
    voltage = _make_steps(-6.0, 6.0, 150, 20, 1)
    speed = np.zeros(len(voltage))
    for k in range(1, len(speed)):
        speed[k] = 0.95 * speed[k - 1] + 0.8 * voltage[k - 1] - 0.9 * np.sign(speed[k - 1])
    return _measure(voltage, speed, 0.05, 0.02, ("drive_V", "speed_rad_s"))


def make_pipe() -> Dataset:
    """Temperature at the end of a heated pipe, twelve seconds behind the heater."""
    heater = _make_steps(0.0, 2.0, 60, 30, 2)
    rise = np.zeros(len(heater))
    for k in range(12, len(rise)):
        rise[k] = 0.93 * rise[k - 1] + 0.7 * heater[k - 12]
    return _measure(heater, rise, 0.02, 1.0, ("heater_kW", "rise_K"))


def make_tanks() -> Dataset:
    """Level of the lower of two tanks, each of which drains with the root of its level."""
    pump = _make_steps(1.0, 3.0, 60, 10, 3)
    upper, lower = np.full(len(pump), 4.0), np.full(len(pump), 4.0)
    for k in range(1, len(pump)):
        upper[k] = upper[k - 1] + 0.4 * pump[k - 1] - 0.4 * np.sqrt(upper[k - 1])
        lower[k] = lower[k - 1] + 0.4 * np.sqrt(upper[k - 1]) - 0.4 * np.sqrt(lower[k - 1])
    return _measure(pump, lower, 0.02, 4.0, ("pump_V", "level_cm"))


#: Records by file name without suffix.
EXAMPLE_RECORDS: Mapping[str, ExampleRecord] = MappingProxyType(
    {
        "piezo": ExampleRecord("piezo actuator: voltage to extension, with hysteresis", make_piezo),
        "motor": ExampleRecord("motor: voltage to speed, with dry friction", make_motor),
        "pipe": ExampleRecord("heated pipe: heater to temperature, with dead time", make_pipe),
        "tanks": ExampleRecord("two tanks: pump to lower level, nonlinear outflow", make_tanks),
    }
)
