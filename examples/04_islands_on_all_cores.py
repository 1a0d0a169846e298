"""Islands on all cores: a larger search in parallel.

An island is a population that evolves on its own. Every few generations the islands exchange individuals
(migration). This tutorial runs the same search in one process and on all cores of this machine with Ray,
and shows that both give the same result, bit for bit.
"""

# %%
# ## A record
#
# The piezo actuator of the tutorial on [hysteresis](02_hysteresis.md), twice as long.
import argparse
import shutil
import tempfile
from pathlib import Path

import numpy as np

import islands

parser = argparse.ArgumentParser(description="Islands in parallel on this machine.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)

rng = np.random.default_rng(0)
time = 0.01 * np.arange(6000)
sines = [(20, 0.31, 1), (12, 0.83, 2), (8, 1.37, 3), (5, 2.1, 4)]
u = sum(size * np.sin(2 * np.pi * frequency * time + phase) for size, frequency, phase in sines)
h = np.zeros(u.size)
for k in range(1, u.size):
    h[k] = h[k - 1]
    change = (u[k] - u[k - 1]) / 20
    for _ in range(20):
        h[k] += 0.9 * change - 0.008 * abs(change) * h[k] - 0.008 * change * abs(h[k])
y = 1.6 * u - h + 0.05 * rng.standard_normal(u.size)
record = islands.Dataset(u, y, 0.01, ("u_V",), "y_um", ("V",), "um")

# %%
# ## In one process
#
# Four islands in a ring: every five generations the best individual of each island goes to the next island.
# Without an engine the islands run one after the other in this process.
settings = {"preset": "hysteresis", "islands": 4, "topology": "ring", "migrate_every": 5, "generations": 20}
serial = islands.identify(record, seed=0, **settings)
print(f"{serial.search_result.search.evaluations} models evaluated")
print(f"error {serial.best.metrics['validation']['free_run'].mape:.3f} %")

# %%
# ## On all cores
#
# `engine="ray"` starts Ray on the cores of this machine and stops it at the end of the search;
# `engine=islands.Ray(cpus=2)` uses two cores. The islands run in several processes at the same time. Starting
# Ray takes a few seconds, so it pays off in searches that take longer than this one.
#
# `on_epoch` is called after the first generation and after every migration, with the state of the search
# and its settings.


def show(state, settings):
    """Print how far the search is."""
    print(f"generation {state.archipelago.generation} of {settings.generations}: {state.evaluations} models")


parallel = islands.identify(record, seed=0, engine="ray", on_epoch=show, **settings)

# %%
# ## The same result
#
# The record, the settings and the seed determine the result. The number of cores does not change it.
print(parallel.best.equation == serial.best.equation)
print(parallel.best)

# %%
# The figure shows the best error of each island over the generations.
parallel.save(out / "result", figures=("islands",))
shutil.copy(out / "result" / "figures" / "islands.svg", out / "islands.svg")

# %%
# ## Next
#
# * [Cluster](05_cluster.md): the same search on several machines.
# * [REST client](08_rest_client.md): send a search to a service.

# %% checks
assert [str(model) for model in parallel.models] == [str(model) for model in serial.models]
for each, other in zip(parallel.models, serial.models, strict=True):
    assert each.model.parameters == other.model.parameters
assert len(parallel.search_result.search.history[-1].islands) == 4
assert parallel.best.metrics["validation"]["free_run"].mape < 0.2
assert parallel.best.physics.property_1
print(f"results in {out}")
