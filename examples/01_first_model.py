"""A first model: from a CSV file to an equation.

You have a CSV file with the input and the output of a system, and you want the difference equation behind
it. This tutorial writes such a file, reads it, finds the equation in two ways, and chooses a model.
"""

# %%
# ## A record
#
# The record comes from a system whose equation is known, so that you can compare the result with the truth.
# The input `u` is a voltage, the output `y` is a level:
#
#     y(k) = 0.8*y(k-1) + 0.4*u(k-1) - 0.1*y(k-1)*u(k-1)
#
# The input is random and keeps each value for five samples. The measured output has noise with a standard
# deviation of 0.01 cm.
import argparse
import tempfile
from pathlib import Path

import numpy as np

import islands

parser = argparse.ArgumentParser(description="From a CSV file to an equation.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)

rng = np.random.default_rng(1)
u = np.repeat(rng.uniform(-1.0, 1.0, 200), 5)
y = np.zeros(u.size)
for k in range(1, u.size):
    y[k] = 0.8 * y[k - 1] + 0.4 * u[k - 1] - 0.1 * y[k - 1] * u[k - 1]
y += 0.01 * rng.standard_normal(u.size)

# %%
# A CSV file has one column per signal. The name of a column ends with its unit, `u_V` and `y_cm`. The
# column `t_s` is the time in seconds.
table = np.column_stack([0.1 * np.arange(u.size), u, y]).round(5)
np.savetxt(out / "level.csv", table, fmt="%g", delimiter=",", header="t_s,u_V,y_cm", comments="")
print(*(out / "level.csv").read_text().splitlines()[:4], sep="\n")

# %%
# `read_record` reads the columns that you name, takes the sampling time from the time column, and refuses a
# file that cannot be used, with the reason.
record = islands.read_record(out / "level.csv", inputs=["u_V"], output="y_cm")
print(f"{record.samples} samples, one every {record.dt:g} s")

# %%
# ## The classical way: fit
#
# `fit` writes down a library of candidate terms, here all products of at most two lagged signals, and
# selects terms one after the other by how much of the output they explain (forward orthogonal regression).
# The last quarter of the record is kept for validation. The result has one model for each number of terms,
# and the best linear model, a state space, which is not printed here.
fitted = islands.fit(record, library="polynomial", degree=2, lags=2)


def print_models(result: islands.Result) -> None:
    """Print the models with terms, by their number."""
    equations = [model for model in result.models if model.model.kind == "narx"]
    for model in sorted(equations, key=lambda model: model.model.size)[:5]:
        error = model.metrics["validation"]["free_run"].mape
        print(f"{model.model.size} terms, error {error:6.3f} %: {model}")


print_models(fitted)

# %%
# The error is that of a *free run* over the validation data. In a free run the model is a simulator: it
# gets the input only, and its own past output instead of the measured one. The error is the mean absolute
# error in per cent of the output's range (MAPE).
#
# With three terms the error reaches the noise, and further terms do not lower it. The equation with three
# terms is the one that made the record.
#
# ## Evolution: identify
#
# `fit` needs a library. `identify` evolves the terms instead, so that powers and lags need not be guessed.
# The preset `narx` is for smooth systems. The same seed gives the same result. Fewer generations than those
# of the preset are enough here.
evolved = islands.identify(record, preset="narx", generations=20, max_terms=6, seed=0)
print_models(evolved)

# %%
# ## Choose a model
#
# `evolved.models[0]` has the least error on the validation data. Here the errors of all models with three or
# more terms differ by chance only, so the recommended model is the smallest of them.
chosen = evolved.best
print(chosen)
for reason in evolved.recommendation.reasons:
    print(reason)

# %%
# The root mean square error of its free run is that of the noise, 0.01 cm.
error = chosen.metrics["validation"]["free_run"]
print(f"RMSE {error.rmse:.4f} cm, R2 {error.r2:.4f}")
chosen.plot("free-run").savefig(out / "free-run.svg")

# %%
# A model can be simulated on any record with the same inputs, and exported to Python, C, MATLAB, LaTeX or
# JSON.
simulated = chosen.simulate(record).y
print(f"level after 10 s: {simulated[100]:.2f} cm simulated, {record.y[100]:.2f} cm measured")
print(chosen.export("latex"))

# %%
# `save` writes everything to a folder: the models as files, the figures, a summary and `result.json`.
evolved.save(out / "result")
print(sorted(path.name for path in (out / "result").iterdir()))

# %%
# ## Next
#
# * [Hysteresis](02_hysteresis.md): a system whose output depends on the path of the input.
# * [Multiple inputs](03_multiple_inputs.md)
# * [Export to C](10_export_to_c.md)

# %% checks
true = {"y(k-1)": 0.8, "u1(k-1)": 0.4, "y(k-1)*u1(k-1)": -0.1}
for model in (chosen, next(model for model in fitted.models if model.model.size == 3)):
    names = [regressor.text for regressor in model.model.regressors]
    terms = dict(zip(names, model.model.parameters, strict=True))
    assert model.model.size == 3
    assert terms.keys() == true.keys(), terms
    assert all(abs(terms[name] - true[name]) < 0.01 for name in true), terms
for result in (fitted, evolved):
    equations = [each for each in result.models if each.model.kind == "narx"]
    errors = {each.model.size: each.metrics["validation"]["free_run"].rmse for each in equations}
    assert errors[2] > 5 * errors[3], errors
    assert all(value > 0.95 * errors[3] for value in errors.values()), errors
large = [value for size, value in errors.items() if size >= 3]
assert max(large) < 1.05 * min(large)
assert 0.009 < error.rmse < 0.011
assert abs(simulated[100] - record.y[100]) < 0.05
print(f"results in {out}")
