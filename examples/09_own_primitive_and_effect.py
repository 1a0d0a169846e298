"""Your own primitive and effect: extend the tables without changing the package.

Models are built from primitives such as `sin` and `abs`, and diagnoses search a catalogue of effects. This
tutorial adds a primitive to the models and their search, and an effect to the diagnosis.
"""

# %%
# ## A primitive
#
# A primitive is a plain function of one or two numbers. `primitive` checks that it is finite at zero, at
# negative and at large arguments, and that it has the declared parity (-1: odd). The bodies in C and MATLAB
# are needed only for exports to these languages.
import argparse
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import lfilter

import islands
from islands.effects import Effect, Parameter, Site

parser = argparse.ArgumentParser(description="Add a primitive and an effect.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)


def soften(a):
    """Limit a number smoothly to the range from -1 to 1."""
    return a / (1.0 + abs(a))


soft = islands.primitive("soften", soften, parity=-1, c="return a / (1.0 + fabs(a));")

# %%
# `parse` reads an expression with the built-in primitives and yours, and `make_model` makes a model from
# terms.
table = islands.PRIMITIVES | {"soften": soft}
terms = [("y(k-1)", 0.9), ("soften(u(k-1))", 0.5)]
model = islands.make_model(((islands.parse(text, table), value) for text, value in terms), dt=0.1)

# %%
# Simulate it on a record. A free run reads the output in the first sample only (one per lag), so the rest
# may be missing (NaN).
u = np.full(50, 3.0)
y = np.full(50, np.nan)
y[0] = 0.0
step = islands.simulate(model, islands.Dataset(u, y, 0.1)).y
print(f"step response: {step[1]:.4f}, {step[2]:.4f}, ..., {step[-1]:.4f}")

# %%
# The model can be written to a file and read again with the same table.
islands.write_model(model, out / "soft.json")
print(islands.read_model(out / "soft.json", table) == model)

# %%
# `identify` searches with names of built-in primitives and with yours. This record follows the model, with
# noise of a standard deviation of 0.01.
rng = np.random.default_rng(8)
u = 3.0 * rng.standard_normal(600)
y = np.zeros(600)
for k in range(1, 600):
    y[k] = 0.9 * y[k - 1] + 0.5 * soften(u[k - 1]) + 0.01 * rng.standard_normal()
law = islands.identify(
    islands.Dataset(u, y, 0.1),
    preset="narx",
    primitives=("mul", soft),
    max_terms=2,
    population=100,
    generations=10,
).best
print(law.equation)

# %%
# ## A record with an unknown cause
#
# A stage follows a voltage with a small lag. Its sensor is a potentiometer, whose output is proportional to
# its supply, which is recorded as well. Noise has a standard deviation of 0.02 um.
DT = 0.01


def stage(u, dt, gain=1.0, tau=0.05):
    """Simulate a stage: a first-order lag with a gain in um/V."""
    pole = np.exp(-dt / tau)
    return lfilter([0.0, gain * (1.0 - pole)], [1.0, -pole], u)


rng = np.random.default_rng(5)
time = DT * np.arange(1000)
u = sum(
    size * np.sin(2 * np.pi * frequency * time + phase)
    for size, frequency, phase in ((6, 0.37, 1), (5, 1.1, 2), (4, 1.9, 3))
)
position = stage(u, DT, gain=1.05, tau=0.06)
supply = 5.0 + 0.06 * np.sin(2 * np.pi * 0.17 * time + 1.0) + 0.03 * np.sin(2 * np.pi * 0.45 * time)
measured = position * supply / supply[0] + 0.02 * rng.standard_normal(u.size)
record = islands.Dataset(
    *(np.column_stack([u, supply]), measured, DT, ("u_V", "supply_V"), "y_um", ("V", "V"), "um")
)

# %%
# The catalogue has gains that depend on time and on temperature, but none that depends on a supply. The
# verdict is `unknown`: the simulation is wrong, but by no effect of the catalogue. The first candidate is
# the nearest one, here a gain that changes over time.
simulator = islands.function_simulator(stage)
diagnosis = islands.diagnose(record, simulator)
print(diagnosis.verdict, [effect.name for effect in diagnosis.effects])
print([candidate.name for candidate in diagnosis.candidates[:3]])

# %%
# ## An effect
#
# This hint leads to a hypothesis, a gain that follows the supply. An `Effect` has
#
# * a site: here the output, so `form` maps the simulated output to the measured one;
# * parameters with unit, nominal value (no effect), and the scale of a typical change;
# * starting points for the calibration;
# * `linear_parameters`: the number of leading parameters to which the response is proportional, by default
#   one;
# * `is_applicable`: whether a record can show the effect.


def form(y, values, context):
    """Multiply the output by the sensitivity at the supply of each sample."""
    supply = context.channels["supply_V"]
    return y * (1.0 + values[0] * (supply - supply[0]))


supply_gain = Effect(
    name="supply-gain",
    summary="The sensitivity of the sensor changes with its supply: y (1 + k (s - s(0)))",
    family="change",
    site=Site.OUTPUT,
    parameters=lambda _context: (Parameter("k", "1/V", 0.0, 0.05),),
    starting_points=lambda _context, _residual: ((0.25,),),
    form=form,
    is_applicable=lambda context: "supply_V" in context.channels,
    source="Doebelin, Measurement Systems, section 3",
)

# %%
# Search for it together with the catalogue:
better = islands.diagnose(record, simulator, effects=(*islands.EFFECTS, supply_gain))
print(better.verdict)
for effect in better.effects:
    for name, value in effect.parameters.items():
        low, high = value.ci95
        print(
            f"{effect.name}: {name} = {value.value:.5f} {value.unit}, 95 % interval {low:.5f} to {high:.5f}"
        )
print(
    f"RMSE on samples that were kept back: {better.gain.before.rmse:.3f} -> {better.gain.after.rmse:.3f} um"
)

# %%
# The interval contains the true value, the inverse of the supply at the first sample, and the error falls to
# that of the noise. In the figure each point is the residual of a sample, over the output.
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
residuals = {"calibrated": better.base.output, "with supply gain": better.best.output}
for (name, output), colour in zip(residuals.items(), ("#d55e00", "#0072b2"), strict=True):
    axes.plot(output, record.y - output, ".", markersize=3, color=colour, label=name)
axes.set(xlabel="output (um)", ylabel="residual (um)")
figure.legend(loc="outside upper center", ncols=2)
figure.savefig(out / "residuals.svg")

# %%
# ## Next
#
# * [Diagnose a simulation](06_diagnose_a_simulation.md)
# * [Export to C](10_export_to_c.md): a model in a controller.

# %% checks
assert abs(step[1] - 0.375) < 1e-12
assert abs(step[2] - 0.7125) < 1e-12
assert islands.read_model(out / "soft.json", table) == model
assert {item.text for item in law.model.regressors} == {"y(k-1)", "soften(u1(k-1))"}
assert diagnosis.verdict == "unknown"
assert not diagnosis.effects
assert diagnosis.candidates[0].name == "input-gain-curve"
assert better.verdict == "named"
assert [effect.name for effect in better.effects] == ["supply-gain"]
low, high = better.effects[0].parameters["k"].ci95
assert low < 1.0 / supply[0] < high, (low, high)
assert better.gain.before.rmse > 0.035
assert 0.018 < better.gain.after.rmse < 0.022
print(f"results in {out}")
