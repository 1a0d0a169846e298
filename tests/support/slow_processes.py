"""Simulated records of processes with slow modes, which measurement noise hides from one step."""

import numpy as np

from islands.records.dataset import Dataset

#: Second pole of the battery, and the noise of its voltage and of the level of the tank.
BATTERY_POLE, BATTERY_NOISE, TANK_NOISE = float(np.exp(-1.0 / 30.0)), 5e-4, 0.01


def make_battery(seed: int, samples: int = 6000) -> Dataset:
    """Return current and voltage of a battery: a linear open-circuit voltage, a resistance and an RC pair."""
    random = np.random.default_rng(seed)
    current, k = np.zeros(samples), 0
    while k < samples:
        length = random.integers(10, 60)
        current[k : k + length] = random.choice([0, 0, 1, 2.5, 5, -2.5])
        k += length
    charge = 0.95 - np.cumsum(current) / 3600 / 2.5
    drop = np.zeros(samples)
    for k in range(1, samples):
        drop[k] = BATTERY_POLE * drop[k - 1] + 0.03 * (1.0 - BATTERY_POLE) * current[k - 1]
    voltage = 3.2 + 0.9 * charge - 0.05 * current - drop + random.normal(0, BATTERY_NOISE, samples)
    return Dataset(current, voltage, 1.0, ("I_A",), "V_V")


def make_tank(seed: int, samples: int = 1000, noise: float = TANK_NOISE) -> Dataset:
    """Return flow and level of a tank, an integrator."""
    random = np.random.default_rng(seed)
    flow = np.repeat(random.uniform(-1, 1, samples // 20 + 1), 20)[:samples]
    level = 1.0 + np.cumsum(np.append(0.0, 0.02 * flow[:-1]))
    return Dataset(flow, level + random.normal(0, noise, samples), 1.0, ("q",), "h")
