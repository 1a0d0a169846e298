"""Hysteresis: a model that keeps its output while the input is constant.

The output of a piezo actuator, of a magnet or of a joint with friction depends on the path of its input.
While the input is constant, so is the output: every value between the two branches of the loop is an
equilibrium (a continuum of equilibria). This tutorial shows what an ordinary model gets wrong there, and
how a constraint on the parameters makes it right.
"""

# %%
# ## A record of a piezo actuator
#
# The Bouc-Wen equations describe the displacement `y` of an actuator under a voltage `u` with a hysteretic
# state `h`. The input is a sum of four sines. The noise has a standard deviation of 0.05 um.
#
#     h' = 0.9 u' - 0.008 |u'| h - 0.008 u' |h|
#     y  = 1.6 u - h
import argparse
import tempfile
from pathlib import Path

import numpy as np

import islands

parser = argparse.ArgumentParser(description="A constrained model of a hysteresis.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)


def displacement(u, steps=20):
    """Integrate the Bouc-Wen equations with ``steps`` Euler steps per sample."""
    h = np.zeros(u.size)
    for k in range(1, u.size):
        h[k] = h[k - 1]
        change = (u[k] - u[k - 1]) / steps
        for _ in range(steps):
            h[k] += 0.9 * change - 0.008 * abs(change) * h[k] - 0.008 * change * abs(h[k])
    return 1.6 * u - h


rng = np.random.default_rng(0)
time = 0.01 * np.arange(3000)
sines = [(20, 0.31, 1), (12, 0.83, 2), (8, 1.37, 3), (5, 2.1, 4)]
u = sum(size * np.sin(2 * np.pi * frequency * time + phase) for size, frequency, phase in sines)
y = displacement(u) + 0.05 * rng.standard_normal(u.size)
record = islands.Dataset(
    u, y, dt=0.01, input_names=("u_V",), input_units=("V",), output_name="y_um", output_unit="um"
)

# %%
# ## With and without the constraint
#
# The preset `hysteresis` builds terms from the increments of the input and their signs. Its constraint
# fixes sums of parameters so that the model reduces to `y(k) = y(k-1)` while the input is constant.
#
# For comparison, the second search has no constraint.
constrained = islands.identify(record, preset="hysteresis", generations=15, seed=0).best
free = islands.identify(record, preset="hysteresis", constraints="none", generations=15, seed=0).best
for name, model in (("constrained", constrained), ("unconstrained", free)):
    error = model.metrics["validation"]["free_run"].mape
    print(f"{name}: {model.model.size} terms, error in free run {error:.2f} %")
    print(f"  {model}")

# %%
# Both errors are about 0.2 %. The error does not show which model is wrong.
#
# ## The loop
#
# Output over input, measured and simulated, on validation data:
constrained.plot("loop").savefig(out / "loop.svg")

# %%
# ## The hold test
#
# `physics` holds the input constant at five levels, each reached while loading and while unloading, and
# measures how far the output drifts, in per cent of the output's range. `property_1` says whether the model
# has a continuum of equilibria.
for name, model in (("constrained", constrained), ("unconstrained", free)):
    print(f"{name}: continuum of equilibria {model.physics.property_1}, "
          f"largest drift {model.physics.hold_drift_percent:.3f} %")  # fmt: skip

# %%
# The constrained model keeps its output. The next figure shows the output before the hold and during it:
constrained.plot("hold").savefig(out / "hold-constrained.svg")

# %%
# The output of the unconstrained model drifts away, although its error on the record is as small:
free.plot("hold").savefig(out / "hold-unconstrained.svg")

# %%
# ## Why
#
# The coefficient of `y(k-1)` is 1 under the constraint. Without it, the estimate is slightly smaller, and
# the output decays while the input is constant. A record in which the input always moves does not show it.
for name, model in (("constrained", constrained), ("unconstrained", free)):
    for regressor, parameter in zip(model.model.regressors, model.model.parameters, strict=True):
        if regressor.text == "y(k-1)":
            print(f"{name}: {parameter:.6f} * y(k-1)")

# %%
# ## Next
#
# * [Diagnose a simulation](06_diagnose_a_simulation.md): find a hysteresis that a simulation lacks.
# * [Islands on all cores](04_islands_on_all_cores.md): a larger search.
# * [Export to C](10_export_to_c.md)

# %% checks
errors = [each.metrics["validation"]["free_run"].mape for each in (constrained, free)]
assert all(0.15 < error < 0.3 for error in errors), errors
assert constrained.physics.property_1
assert not free.physics.property_1
assert constrained.physics.hold_drift_percent < 1e-6
assert free.physics.hold_drift_percent > 5.0
first = [dict(zip([r.text for r in each.model.regressors], each.model.parameters, strict=True))["y(k-1)"]
         for each in (constrained, free)]  # fmt: skip
assert abs(first[0] - 1.0) < 1e-9
assert 0.99 < first[1] < 1.0 - 1e-6
assert len(constrained.physics.holds) == 10
print(f"results in {out}")
