"""Your own simulator: diagnose a Python function.

Your simulation need not be one of the built-in systems. Any Python function from an input to an output can
be diagnosed. This tutorial writes a simulation of an oven, calibrates it, and finds out that the amplifier
of the heater saturates.
"""

# %%
# ## The simulator
#
# A simulator is a function `(u, dt, **parameters) -> y`. It gets the input of shape `(samples,)` and the
# sampling time in seconds, and returns the output of the same shape. Each parameter has a number as its
# default: its nominal value. The diagnosis calibrates the parameters.
import argparse
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import lfilter

import islands

parser = argparse.ArgumentParser(description="Diagnose a Python function.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)


def oven(u, dt, gain=20.0, tau=2.0):
    """Simulate an oven: a first-order system with a gain in K/kW and a time constant in seconds."""
    pole = np.exp(-dt / tau)
    return lfilter([0.0, gain * (1.0 - pole)], [1.0, -pole], u)


# %%
# ## The measurement
#
# The real oven has a gain of 22 K/kW and a time constant of 2.5 s. These differ from the nominal values,
# which is no discrepancy: calibration corrects it. But the amplifier also limits the power to 1.5 kW, and
# the simulation does not know that. The noise has a standard deviation of 0.05 K.
DT = 0.1
rng = np.random.default_rng(4)
time = DT * np.arange(1000)
sines = [(0.021, 1), (0.057, 2), (0.11, 3), (0.23, 4)]
u = 1.0 + 0.25 * sum(np.sin(2 * np.pi * frequency * time + phase) for frequency, phase in sines)


def measure(power):
    """Return a record of the real oven; the record has the commanded power as its input."""
    y = oven(power, DT, gain=22.0, tau=2.5) + 0.05 * rng.standard_normal(power.size)
    return islands.Dataset(u, y, DT, ("u_kW",), "y_K", ("kW",), "K")


intact = measure(u)
limited = measure(np.minimum(u, 1.5))
print(f"the commanded power reaches {u.max():.2f} kW")

# %%
# ## Diagnose it
#
# `function_simulator` makes a simulator from a function. Values that you know better than the defaults are
# given by name: `function_simulator(oven, gain=21.0)`. On the command line the function is named by its
# file: `--simulation python:oven.py:oven`.
simulator = islands.function_simulator(oven)
print("without a limit:", islands.diagnose(intact, simulator).verdict)

diagnosis = islands.diagnose(limited, simulator)
print("with a limit:", diagnosis.verdict)
for effect in diagnosis.effects:
    for name, value in effect.parameters.items():
        print(f"{effect.name}: {name} = {value.value:.3f}, confidence {effect.confidence:.2f}")

# %%
# `cut` is the part of the peak that is missing. It gives the limit of the power:
cut = diagnosis.effects[0].parameters["cut"].value
print(f"limit {(1.0 - cut) * u.max():.3f} kW")

# %%
# ## Calibrated parameters
#
# `base` is the simulation calibrated without the effect, `best` the one with it. The saturation distorts
# the calibration of `base`; `best` recovers the true values, 22 K/kW and 2.5 s.
for name, calibrated in (("without the effect", diagnosis.base), ("with the effect", diagnosis.best)):
    values = zip(simulator.parameters, calibrated.values, strict=False)
    print(f"{name}: " + ", ".join(f"{parameter.name} = {value:.3f}" for parameter, value in values))

# %%
figure, axes = plt.subplots(2, 1, figsize=(7, 4.5), sharex=True, layout="constrained")
axes[0].plot(time, limited.y, color="0.2", linewidth=2.5, label="measured")
axes[0].plot(time, diagnosis.base.output, color="#d55e00", linewidth=1, label="calibrated")
axes[0].plot(time, diagnosis.best.output, color="#0072b2", linewidth=1, label="with saturation")
axes[1].plot(time, limited.y - diagnosis.base.output, color="#d55e00", linewidth=1)
axes[1].plot(time, limited.y - diagnosis.best.output, color="#0072b2", linewidth=1)
axes[0].set(ylabel="temperature (K)")
axes[1].set(xlabel="time (s)", ylabel="residual (K)")
figure.legend(loc="outside upper center", ncols=3)
figure.savefig(out / "residuals.svg")

# %%
# ## Parameters that you know
#
# By default each parameter is free, so an effect that another parameter value can imitate is not reported.
# If you know a parameter, give its relative standard deviation as a tolerance. If all parameters have a
# tolerance, wrong gains and wrong parameters become effects that can be found: here the gain of 22 differs
# from the nominal 20 by 10 %.
known = islands.diagnose(intact, simulator, tolerance={"gain": 0.01, "tau": 0.5})
for effect in known.effects:
    print(effect.name, [f"{name} = {value.value:.3f}" for name, value in effect.parameters.items()])
    print("not distinguishable from:", effect.equivalents)

# %%
# The simulation lacks about 10 % of gain. A gain of the input, of the sensor and of the oven change this
# output alike, so the record cannot tell them apart: `equivalents` lists the names between which you have
# to decide.

# %%
# ## Next
#
# * [Your own primitive and effect](09_own_primitive_and_effect.md)
# * [Diagnose a simulation](06_diagnose_a_simulation.md): how to read a diagnosis.

# %% checks
assert diagnosis.verdict == "named"
assert [effect.name for effect in diagnosis.effects] == ["input-saturation"]
assert abs((1.0 - cut) * u.max() - 1.5) < 0.005
gain, tau = diagnosis.best.values[:2]
assert abs(gain - 22.0) < 0.02
assert abs(tau - 2.5) < 0.01
assert abs(diagnosis.base.values[0] - 22.0) > 0.2
assert known.effects[0].name == "input-gain"
assert abs(known.effects[0].parameters["k"].value - 0.1) < 0.01
assert {"wrong-parameter", "sensor-gain"} < set(known.effects[0].equivalents)
print(f"results in {out}")
