"""Cluster: the islands of one search on several machines.

The same code runs on one machine and on a Ray cluster. Only the address of the cluster differs. This
tutorial reads the address from the option `--address` or from the environment variable
`ISLANDS_RAY_ADDRESS`. Without an address it starts Ray on this machine.
"""

# %%
# ## Start a cluster
#
# Install the package in the same version on each machine. Start Ray on the first machine, then on the
# others. The token keeps other users out; Ray listens on all network interfaces, so keep it behind a
# firewall as well.
#
#     export RAY_AUTH_TOKEN=...                       # the same secret on all machines
#     ray start --head --port 6379                    # on the first machine, called "head" here
#     ray start --address head:6379                   # on each other machine
#     python 05_cluster.py --address head:6379        # where you work
#
# Machines may join or leave while a search runs. If a machine fails, its islands continue on another one
# from their last migration, and the result does not change.
import argparse
import os
import tempfile
from pathlib import Path

import numpy as np

import islands

parser = argparse.ArgumentParser(description="Islands on a Ray cluster.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
parser.add_argument("--address", default=os.environ.get("ISLANDS_RAY_ADDRESS"), help="HOST:PORT of the head")
arguments = parser.parse_args()
out = arguments.out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)
address = arguments.address
print(f"cluster {address}" if address else "no address is given: Ray starts on this machine")

# %%
# ## A search with a budget
#
# The record is a level with a nonlinear outflow. Eight islands search at most 30 generations. The search
# ends earlier if `max_evaluations` models have been evaluated or if a model reaches `target_error`, in the
# unit of the output. An island needs one CPU while it works; islands in excess of the CPUs wait for their
# turn.
rng = np.random.default_rng(1)
u = np.repeat(rng.uniform(0.0, 1.0, 200), 5)
level = np.zeros(u.size)
for k in range(1, u.size):
    level[k] = 0.95 * level[k - 1] + 0.3 * u[k - 1] - 0.02 * level[k - 1] ** 2
level += 0.005 * rng.standard_normal(u.size)
record = islands.Dataset(u, level, 1.0, ("u_V",), "level_cm", ("V",), "cm")

result = islands.identify(
    record,
    preset="narx",
    seed=0,
    engine=islands.Ray(address=address),
    islands=8,
    population=50,
    generations=30,
    max_terms=5,
    max_evaluations=8000,
)

# %%
# `ended_by` names the budget that ended the search.
search = result.search_result.search
print(f"ended by {search.ended_by} after {search.generations} generations, {search.evaluations} models")
chosen = next(model for model in result.models if model.model.size == 3)
error = chosen.metrics["validation"]["free_run"]
print(f"RMSE {error.rmse:.4f} cm: {chosen}")

# %%
# The model with three terms is the true equation, and its error is that of the noise, 0.005 cm. The same
# seed gives the same models on any cluster.
(out / "model.json").write_text(chosen.export("json"))
chosen.plot("free-run").savefig(out / "free-run.svg")

# %%
# ## Next
#
# * [REST client](08_rest_client.md): a service that queues searches and survives restarts.
# * [Islands on all cores](04_islands_on_all_cores.md)

# %% checks
assert search.ended_by == "evaluations"
assert 8000 <= search.evaluations < 9000
assert search.generations < 30
names = [regressor.text for regressor in chosen.model.regressors]
found = dict(zip(names, chosen.model.parameters, strict=True))
true = {"y(k-1)": 0.95, "u1(k-1)": 0.3, "y(k-1)^2": -0.02}
assert found.keys() == true.keys(), found
assert all(abs(found[name] / true[name] - 1.0) < 0.02 for name in true), found
assert 0.0045 < error.rmse < 0.0056
print(f"results in {out}")
