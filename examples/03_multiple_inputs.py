"""Multiple inputs: several inputs and several recordings.

A system often has more than one input, and its data often come in several files. This tutorial identifies a
heated box with two inputs from two recordings, and validates on a third one. It also finds the dead time of
an input.
"""

# %%
# ## Three recordings
#
# A heater with the power `heater_kW` warms a box. A fan with the speed `fan`, from 0 to 1, cools it. The
# cooling is proportional to the temperature and acts one sample later than the heating. The temperature
# `T_K` is that above the surroundings, sampled every second. The noise has a standard deviation of 0.02 K.
#
#     T(k) = 0.9 T(k-1) + 2 heater(k-1) - 0.15 T(k-1) fan(k-2)
import argparse
import tempfile
from pathlib import Path

import numpy as np

import islands

parser = argparse.ArgumentParser(description="A model with two inputs from several recordings.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)


def write_recording(path, samples, seed):
    """Simulate the box with random inputs and write a CSV file."""
    rng = np.random.default_rng(seed)
    heater = np.repeat(rng.uniform(0.0, 1.0, samples // 10), 10)
    fan = np.repeat(rng.uniform(0.0, 1.0, samples // 15), 15)
    temperature = np.zeros(samples)
    for k in range(2, samples):
        cooling = 0.15 * temperature[k - 1] * fan[k - 2]
        temperature[k] = 0.9 * temperature[k - 1] + 2.0 * heater[k - 1] - cooling
    temperature += 0.02 * rng.standard_normal(samples)
    columns = [np.arange(samples), heater, fan, temperature]
    np.savetxt(
        path, np.column_stack(columns), fmt="%.5f", delimiter=",", header="t_s,heater_kW,fan,T_K", comments=""
    )


paths = [out / f"recording-{number}.csv" for number in (1, 2, 3)]
for seed, (path, samples) in enumerate(zip(paths, (600, 900, 600), strict=True)):
    write_recording(path, samples, seed)

# %%
# Name the inputs in the order that you want. In equations they are `u1`, `u2`, and so on.
first, second, validation = [
    islands.read_record(path, inputs=["heater_kW", "fan"], output="T_K") for path in paths
]

# %%
# `join` puts recordings of the same system together. Each stays a segment: no model reads across the
# boundary between two segments.
estimation = islands.join((first, second))
print(f"{estimation.samples} samples in segments of {estimation.segments}, inputs {estimation.input_names}")

# %%
# ## Fit
#
# The second argument is the validation data: a record, or the fraction of the first record that is kept at
# its end.
result = islands.fit(estimation, validation=validation, library="polynomial", degree=2, lags=3)
for model in sorted(result.models, key=lambda model: model.model.size)[:5]:
    error = model.metrics["validation"]["free_run"].rmse
    print(f"{model.model.size} terms, RMSE {error:.4f} K: {model}")

# %%
# Three terms reach the noise of 0.02 K, and more terms do not lower the error. The equation with three
# terms is the true one: the selection found the product of temperature and fan, and the dead time of the
# fan, `u2(k-2)`.
chosen = next(model for model in result.models if model.model.size == 3)
chosen.plot("free-run").savefig(out / "free-run.svg")

# %%
# ## Is the second input needed?
#
# Without the fan the error is much larger, however many terms the model has. `first_inputs(1)` keeps the
# first input only.
alone = islands.fit(
    estimation.first_inputs(1), validation=validation.first_inputs(1), library="polynomial", degree=2, lags=3
)
for name, model in (("heater and fan", chosen), ("heater only", alone.best)):
    error = model.metrics["validation"]["free_run"]
    print(f"{name}: RMSE {error.rmse:.3f} K, {error.mape:.2f} % of the range")

# %%
# ## Standard errors
#
# Each parameter has a standard error. It says how well the data determine the parameter, if the model is
# right and the noise is white.
for regressor, value, error in zip(
    chosen.model.regressors, chosen.model.parameters, chosen.model.standard_errors, strict=True
):
    print(f"{regressor.text:16} {value:8.4f} +- {error:.4f}")

# %%
# ## Next
#
# * [Islands on all cores](04_islands_on_all_cores.md): evolve the terms in parallel.
# * [Diagnose a simulation](06_diagnose_a_simulation.md): test a simulation that you have already.

# %% checks
errors = {model.model.size: model.metrics["validation"]["free_run"].rmse for model in result.models}
assert 0.018 < errors[3] < 0.022, errors
assert errors[2] > 10 * errors[3], errors
assert all(error > 0.97 * errors[3] for error in errors.values()), errors
true = {"y(k-1)": 0.9, "u1(k-1)": 2.0, "y(k-1)*u2(k-2)": -0.15}
names = [regressor.text for regressor in chosen.model.regressors]
found = dict(zip(names, chosen.model.parameters, strict=True))
assert found.keys() == true.keys(), found
assert all(abs(found[name] / true[name] - 1.0) < 0.01 for name in true), found
assert min(each.metrics["validation"]["free_run"].rmse for each in alone.models) > 10 * errors[3]
assert estimation.segments == (600, 900)
print(f"results in {out}")
