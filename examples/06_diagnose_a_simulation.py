"""Diagnose a simulation: name the effect that is missing.

You have a record of a system and a simulation of it, and the two differ. `diagnose` calibrates the
simulation, tests more than thirty physical effects that it may lack, and names the cause. This tutorial
hides dry friction in the data of an oscillator and lets the diagnosis find it. It also shows the answer for
data without a hidden effect.
"""

# %%
# ## Two records
#
# The system is a mass on a spring with a damper. The force `u_N` drives it, the position `y_mm` is measured
# with noise of 0.5 mm (standard deviation) at a range of about 500 mm.
#
#     1 kg x'' + 1.5 Ns/m x' + 100 N/m x + F sign(x') = u
#
# The second record has dry friction, F = 0.6 N. It is not in the simulation.
import argparse
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import islands

parser = argparse.ArgumentParser(description="Find what a simulation lacks.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)

DT = 0.01


def measure(u, friction, seed):
    """Integrate the oscillator by the Runge-Kutta method, four steps per sample, and add noise."""
    rng = np.random.default_rng(seed)
    state, step, x = np.zeros(2), DT / 4, np.zeros(u.size)

    def derivative(state, force):
        resistance = 1.5 * state[1] + 100 * state[0] + friction * np.tanh(state[1] / 0.01)
        return np.array([state[1], force - resistance])

    for k in range(1, u.size):
        for begin in np.arange(4) / 4:
            f0, f1, f2 = (u[k - 1] + (u[k] - u[k - 1]) * (begin + part) for part in (0, 1 / 8, 1 / 4))
            a = derivative(state, f0)
            b = derivative(state + step / 2 * a, f1)
            c = derivative(state + step / 2 * b, f1)
            d = derivative(state + step * c, f2)
            state = state + step / 6 * (a + 2 * b + 2 * c + d)
        x[k] = state[0]
    y = 1000 * x + 0.5 * rng.standard_normal(u.size)
    return islands.Dataset(u, y, DT, ("u_N",), "y_mm", ("N",), "mm")


time = DT * np.arange(1000)
sines = [(6, 0.37, 1), (5, 1.1, 2), (4, 1.9, 3), (3, 3.1, 4)]
u = sum(size * np.sin(2 * np.pi * frequency * time + phase) for size, frequency, phase in sines)
clean = measure(u, friction=0.0, seed=2)
rubbing = measure(u, friction=0.6, seed=2)

# %%
# ## Clean data
#
# `second-order` is the linear oscillator. Mass, damping and stiffness need not be known: they are
# estimated. If the simulation explains the record within its noise, the verdict is `nothing`.
without = islands.diagnose(clean, "second-order")
print(without.verdict)

# %%
# ## Data with friction
diagnosis = islands.diagnose(rubbing, "second-order")
print(diagnosis.verdict)
for effect in diagnosis.effects:
    print(f"{effect.name}, confidence {effect.confidence:.2f}")
    for name, parameter in effect.parameters.items():
        low, high = parameter.ci95
        print(f"  {name} = {parameter.value:.3f} {parameter.unit}, 95 % interval {low:.3f} to {high:.3f}")
    print(f"  not distinguishable from: {', '.join(effect.equivalents) or 'nothing else'}")

# %%
# The diagnosis names dry friction, and the interval contains the hidden value of 0.6 N. *Confidence*
# compares the effect with the others that would explain the same data.
#
# `candidates` has the score of each effect alone: twice the gain in log-likelihood, minus a penalty for the
# number of parameters. The second effect scores less than half as much.
for candidate in diagnosis.candidates[:3]:
    print(f"{candidate.name:20} score {candidate.score:7.1f}")

# %%
# ## What the correction is worth
#
# The last quarter of the record is kept back: neither the calibration nor the search uses it. `gain`
# compares the calibrated simulation there without and with the effect.
gain = diagnosis.gain
print(f"RMSE before {gain.before.rmse:.2f} mm, after {gain.after.rmse:.2f} mm")
print(f"reduction {gain.reduction_percent:.0f} %")

# %%
# After the correction the error is that of the noise. The figure shows the residuals, measured minus
# simulated. The part that was kept back is grey.
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
axes.axvspan(time[diagnosis.estimation_samples], time[-1], color="0.9")
axes.plot(time, rubbing.y - diagnosis.base.output, color="#d55e00", label="calibrated simulation")
axes.plot(time, rubbing.y - diagnosis.best.output, color="#0072b2", label="with dry friction")
axes.set(xlabel="time (s)", ylabel="residual (mm)")
figure.legend(loc="outside upper center", ncols=2)
figure.savefig(out / "residuals.svg")

# %%
# ## Other simulations
#
# The second argument names the simulation. It can be a linear model (`linear:2`), an identified model
# (`model:model.json`), a physical system (`cascaded-tanks`), or your own function. A simulation that runs
# elsewhere is given as a column, its output with one value per sample: `islands.diagnose(record,
# "column:y_sim", columns={"y_sim": values})`. Effects inside its equation, such as this friction, cannot be
# found then.

# %%
# ## Next
#
# * [Your own simulator](07_own_simulator.md)
# * [Your own primitive and effect](09_own_primitive_and_effect.md): search for an effect that the catalogue
#   lacks.

# %% checks
assert without.verdict == "nothing"
assert not without.effects
assert len(islands.EFFECTS) > 30
assert diagnosis.verdict == "named"
assert [effect.name for effect in diagnosis.effects] == ["coulomb-friction"]
found = diagnosis.effects[0]
low, high = found.parameters["F"].ci95
assert low < 0.6 < high
assert high - low < 0.03
assert found.confidence > 0.99
assert diagnosis.candidates[0].name == "coulomb-friction"
assert diagnosis.candidates[1].score < 0.5 * diagnosis.candidates[0].score
assert 0.4 < gain.after.rmse < 0.6
assert gain.before.rmse > 2.0
assert 450 < rubbing.output_range < 550
assert abs(diagnosis.estimation_samples - 750) <= 1
print(f"results in {out}")
