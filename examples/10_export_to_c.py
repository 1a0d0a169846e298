"""Export to C: a model in a controller.

A model can be exported as one file of C99 that needs only the standard library. This tutorial identifies a
model, exports it, compiles it, and shows that the program computes the same numbers as the Python model.
"""

# %%
# ## A model
#
# The record is a level with a quadratic outflow.
import argparse
import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import islands

parser = argparse.ArgumentParser(description="Export a model to C and compile it.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)

rng = np.random.default_rng(1)
u = np.repeat(rng.uniform(0.0, 1.0, 200), 5)
level = np.zeros(u.size)
for k in range(1, u.size):
    level[k] = 0.95 * level[k - 1] + 0.3 * u[k - 1] - 0.02 * level[k - 1] ** 2
level += 0.005 * rng.standard_normal(u.size)
record = islands.Dataset(u, level, 1.0, ("u_V",), "level_cm", ("V",), "cm")

result = islands.fit(record, library="polynomial", degree=2, lags=2)
model = next(each for each in result.models if each.model.size == 3)
print(model)

# %%
# ## C source
#
# `predict` computes one sample from the samples before it, for a controller that measures the output.
# `simulate` is a free run over a whole input.
(out / "model.c").write_text(model.export("c"))
print((out / "model.c").read_text())

# %%
# ## Compile it
#
# Without fused multiply-add (`-ffp-contract=off`) the compiler keeps the order of all roundings.
compiler = shutil.which("cc")
library = out / "model.so"
command = [
    compiler,
    "-std=c99",
    "-O2",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-ffp-contract=off",
    "-shared",
    "-fPIC",
]
subprocess.run([*command, "-o", library, out / "model.c", "-lm"], check=True)

# %%
# ## Compare
#
# Both programs start from the same first samples and get the same input.
lag = model.model.maximum_lag
python = model.simulate(record, warm_up=lag).y

compiled = np.zeros(record.samples)
compiled[:lag] = record.y[:lag]
inputs = np.ascontiguousarray(record.u[:, 0])
pointer = ctypes.POINTER(ctypes.c_double)
simulate = ctypes.CDLL(str(library)).simulate
simulate.restype = None
simulate(inputs.ctypes.data_as(pointer), compiled.ctypes.data_as(pointer), ctypes.c_size_t(record.samples))

difference = np.abs(compiled[lag:] - python[lag:]).max()
print(f"{record.samples - lag} samples, largest difference {difference}")

# %%
# The difference is exactly zero. Models with `exp`, `log`, `sin`, `cos` or `tanh` may differ in the last
# bits, because each machine has its own library for these.
#
# ## Other languages
#
# The other formats are `python` (a module that needs only `math`), `matlab`, `latex`, `mathml`, `plain` and
# `json`.
print(model.export("matlab"))

# %%
# ## Next
#
# * [A first model](01_first_model.md)
# * [Your own primitive and effect](09_own_primitive_and_effect.md)

# %% checks
assert difference == 0.0
assert model.model.size == 3
assert "predict" in model.export("python")
print(f"results in {out}")
