"""REST client: send jobs to a service.

The service queues searches and diagnoses, runs them on its own machine or on a cluster, and keeps the
results. A job that was accepted survives a restart. This tutorial starts a service, submits a job from
Python, follows it, and fetches the result.
"""

# %%
# ## Start the service
#
# On a server you start it with `islands serve` and leave it running. Here it gets a free port of this
# machine and a temporary folder, and the script stops it at the end. On other addresses than 127.0.0.1 the
# service requires keys.
import argparse
import atexit
import socket
import subprocess
import sysconfig
import tempfile
from pathlib import Path

import numpy as np

import islands
from islands_api import Client

parser = argparse.ArgumentParser(description="A job for a service.")
parser.add_argument("--out", type=Path, help="folder of the results; a temporary one by default")
out = parser.parse_args().out or Path(tempfile.mkdtemp(prefix="islands-"))
out.mkdir(parents=True, exist_ok=True)

with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]

data = tempfile.TemporaryDirectory(prefix="islands-service-")
command = [
    Path(sysconfig.get_path("scripts")) / "islands",
    "serve",
    "--port",
    str(port),
    "--data-dir",
    data.name,
]
with (out / "service.log").open("w") as log:
    service = subprocess.Popen(command, stdout=log, stderr=log)


def stop():
    """Stop the service; unfinished jobs would continue after the next start."""
    service.terminate()
    service.wait(60)


atexit.register(stop)

# %%
# ## A record
#
# The service takes CSV, NPZ, MAT and Parquet files. This one has 1000 samples of a level with a quadratic
# outflow.
rng = np.random.default_rng(1)
u = np.repeat(rng.uniform(0.0, 1.0, 200), 5)
level = np.zeros(u.size)
for k in range(1, u.size):
    level[k] = 0.95 * level[k - 1] + 0.3 * u[k - 1] - 0.02 * level[k - 1] ** 2
level += 0.005 * rng.standard_normal(u.size)
record = islands.Dataset(u, level, 1.0, ("u_V",), "level_cm", ("V",), "cm")
islands.write_record(record, out / "level.csv")

# %%
# ## Upload
#
# A `Client` repeats a call that got no answer, so it also waits for a service that starts. The service
# inspects the file and describes its columns.
client = Client(f"http://127.0.0.1:{port}", retry=60.0)
dataset = client.upload(out / "level.csv")
print(f"{dataset.preview.samples} samples, dt = {dataset.preview.dt:g} s")
for column in dataset.preview.columns:
    print(f"  {column.name}: {column.minimum:.3f} to {column.maximum:.3f} {column.unit}")

# %%
# ## Submit a job
#
# The arguments are those of `islands.identify`. The data set, the settings and the seed determine the
# result.
job = client.submit(
    dataset, inputs=["u_V"], output="level_cm", preset="narx", seed=0, islands=2, generations=10, max_terms=5
)
print(job.kind, job.state)

# %%
# ## Follow it
#
# `progress` yields the job at every change until it has ended. If the service restarts meanwhile, the
# client waits for it. `wait` does the same without the intermediate states, and raises an error if the job
# fails.
states = []
for now in client.progress(job, seconds=120):
    if now.state not in states:
        states.append(now.state)
        print(now.state)

# %%
# ## Fetch the result
#
# `models` are the models with their metrics, best first. `export` and `figure` give a model as text and as
# SVG.
models = client.models(job)
for model in sorted(models, key=lambda model: model.size):
    error = model.metrics["validation"]["free_run"]["rmse"]
    print(f"{model.size} terms, RMSE {error:.4f} cm: {model.equation}")
chosen = next(model for model in models if model.size == 3)
(out / "model.m").write_text(client.export(job, chosen.rank, "matlab"))
(out / "free-run.svg").write_bytes(client.figure(job, "free-run", chosen.rank))
(out / "report.html").write_bytes(client.report(job))

# %%
# `report.html` is one file with all models and figures. The result is the same as that of
# `islands.identify` with the same settings:
local = islands.identify(
    islands.read_record(out / "level.csv", inputs=["u_V"], output="level_cm"),
    preset="narx",
    seed=0,
    islands=2,
    generations=10,
    max_terms=5,
)
print([model.equation for model in models] == [model.equation for model in local.models])

# %%
# ## Stop the service
client.close()
stop()
data.cleanup()
print(f"the service ended with exit code {service.returncode}")

# %%
# ## Next
#
# * [Cluster](05_cluster.md): the cores of several machines.
# * [Islands on all cores](04_islands_on_all_cores.md)

# %% checks
assert dataset.preview.samples == 1000
assert states[-1] == "succeeded"
assert [model.equation for model in models] == [model.equation for model in local.models]
assert service.returncode == 0
assert "<svg" in (out / "free-run.svg").read_text()
print(f"results in {out}")
