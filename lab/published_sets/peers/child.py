"""Run of a peer in a child process: a script fits a model to the data of a request, and simulates tests.

The process has the virtual environment of the peer, so that this module imports NumPy and the standard
library only, and nothing of this package. The package writes the requests and reads the answers with it.

A script has two functions: ``list_candidates(task)`` returns the candidates of a setting, ``fit(recordings,
candidate, task)`` a function that simulates. The candidates are compared by the free run of the last quarter
of each recording, and the best one is fitted to all data.
"""

import resource
import runpy
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Simulates the outputs of all samples from the inputs of all samples and the first outputs.
Simulate = Callable[[Array, Array], Array]

#: Values of a setting by name.
Candidate = dict[str, Any]

#: Part of each recording on which candidates are fitted; the rest compares them.
_FITTED = 0.75

#: Time that has to be left for a candidate, relative to the longest one before: later ones take longer, and
#: the best one is fitted to all data in the end.
_RESERVE = 5.0


@dataclass(frozen=True, eq=False)
class PeerRecording:
    """A recording without gaps, as arrays (samples, inputs) and (samples, outputs).

    Of the recording of a test, ``y`` has the initial samples only.
    """

    u: Array
    y: Array


@dataclass(frozen=True, eq=False)
class PeerTask:
    """Estimation data of a set, with mean 0 and standard deviation 1 of each input and output.

    Attributes
    ----------
    recordings : list of PeerRecording
    known : int
        Initial samples from which a free run starts: the largest possible lag.
    limit : float
        CPU seconds after which the process is ended.
    """

    recordings: Sequence[PeerRecording]
    known: int
    limit: float

    @property
    def seconds_left(self) -> float:
        """CPU seconds until the limit."""
        return self.limit - measure_cpu()

    def split(self) -> tuple[list[PeerRecording], list[PeerRecording]]:
        """Return the recordings for the fit of candidates, and those for their comparison."""
        fitted, held_out = [], []
        for each in self.recordings:
            end = int(_FITTED * len(each.u))
            begin = max(0, end - self.known)
            fitted.append(PeerRecording(each.u[:end], each.y[:end]))
            held_out.append(PeerRecording(each.u[begin:], each.y[begin:]))
        return fitted, held_out

    def measure_error(self, simulate: Simulate, recordings: Sequence[PeerRecording]) -> float:
        """Return the RMSE of free runs; infinite if one diverges."""
        squares = [
            ((simulate(each.u, each.y[: self.known]) - each.y)[self.known :] ** 2).ravel()
            for each in recordings
        ]
        error = float(np.sqrt(np.mean(np.concatenate(squares))))
        return error if np.isfinite(error) else np.inf

    @staticmethod
    def run_freely(predict: Simulate, lag: int) -> Simulate:
        """Return a simulation that predicts from the last of the given outputs on.

        Parameters
        ----------
        predict : callable
            Returns an output for each input; takes the inputs, and the outputs of the first `lag` of them.
        lag : int
        """

        def simulate(u: Array, y: Array) -> Array:
            start = len(y) - lag
            return np.vstack([y[:start], predict(u[start:], y[start:])])

        return simulate

    @staticmethod
    def make_rows(recording: PeerRecording, lags: int) -> tuple[Array, Array]:
        """Return rows ``y(k-1), ..., y(k-lags), u(k), ..., u(k-lags)``, and the outputs ``y(k)``."""
        u, y = recording.u, recording.y
        past = [y[lags - lag : len(y) - lag] for lag in range(1, lags + 1)]
        inputs = [u[lags - lag : len(u) - lag] for lag in range(lags + 1)]
        return np.hstack([*past, *inputs]), y[lags:]


def measure_cpu() -> float:
    """Return the CPU seconds of this process, user and system."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def choose(script: Mapping[str, Any], task: PeerTask) -> tuple[Simulate, str]:
    """Return the model with the least error of its free run on the held-out data, and its candidate as text.

    Candidates for which no time is left are left out. The model is fitted again on all data, and taken if its
    error on them is not larger.
    """
    fitted, held_out = task.split()
    best: tuple[float, Candidate, Simulate] | None = None
    reason, longest = "the script has no candidates", 0.0
    for candidate in script["list_candidates"](task):
        began = measure_cpu()
        if began + _RESERVE * longest > task.limit:
            break
        try:
            model = script["fit"](fitted, candidate, task)
            error = task.measure_error(model, held_out)
        except Exception as raised:  # what a peer raises depends on the peer and its version
            error, reason = np.inf, f"{type(raised).__name__}: {raised}"
        else:
            reason = "the free run diverges"
        longest = max(longest, measure_cpu() - began)
        print(f"{candidate}: {error:.4g}, {measure_cpu() - began:.1f} s", flush=True)
        if error < (np.inf if best is None else best[0]):
            best = error, candidate, model
    if best is None:
        sys.exit(f"no candidate has an error on the held-out data, the last one because: {reason}")
    _, candidate, model = best
    again = script["fit"](task.recordings, candidate, task)
    if task.measure_error(again, task.recordings) <= task.measure_error(model, task.recordings):
        model = again
    return model, ", ".join(f"{name} {value}" for name, value in candidate.items())


def write_request(
    folder: Path,
    estimation: Sequence[PeerRecording],
    tests: Sequence[PeerRecording],
    limit: float,
) -> None:
    """Write the data of a run to a folder."""
    arrays: dict[str, Any] = {
        f"{kind}-{number}-{name}": values
        for kind, recordings in (("estimation", estimation), ("test", tests))
        for number, each in enumerate(recordings)
        for name, values in (("u", each.u), ("y", each.y))
    }
    np.savez(folder / "request.npz", limit=limit, **arrays)


def read_answer(folder: Path) -> tuple[list[Array], str]:
    """Return the simulations of the tests, and the chosen setting."""
    with np.load(folder / "answer.npz") as arrays:
        simulated = [np.asarray(arrays[f"test-{number}"], float) for number in range(len(arrays.files) - 1)]
        return simulated, str(arrays["chosen"])


def _read_request(folder: Path) -> tuple[list[PeerRecording], list[PeerRecording], float]:
    with np.load(folder / "request.npz") as arrays:

        def read(kind: str) -> list[PeerRecording]:
            count = sum(name.startswith(kind) for name in arrays.files) // 2
            pairs = ([arrays[f"{kind}-{number}-{name}"] for name in "uy"] for number in range(count))
            return [PeerRecording(u, y) for u, y in pairs]

        return read("estimation"), read("test"), float(arrays["limit"])


def main(script: str, folder: Path) -> None:
    """Answer the request of a folder by a script."""
    estimation, tests, limit = _read_request(folder)
    # The signal at the limit writes the memory of the process to a file where the system allows it.
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (int(np.ceil(limit)), resource.RLIM_INFINITY))
    scales = {}
    for name in "uy":
        values = np.vstack([getattr(each, name) for each in estimation])
        spread = values.std(axis=0)
        scales[name] = values.mean(axis=0), np.where(spread > 0.0, spread, 1.0)

    def scale(recording: PeerRecording) -> PeerRecording:
        return PeerRecording(
            *((getattr(recording, name) - mean) / spread for name, (mean, spread) in scales.items())
        )

    known = min(len(each.y) for each in tests)
    task = PeerTask([scale(each) for each in estimation], known, limit)
    simulate, chosen = choose(runpy.run_path(script), task)
    mean, spread = scales["y"]
    simulated = {
        f"test-{number}": mean + spread * simulate(each.u, each.y)
        for number, each in enumerate(map(scale, tests))
    }
    np.savez(folder / "answer.npz", chosen=chosen, **simulated)


if __name__ == "__main__":
    np.seterr(all="ignore")  # a free run that diverges is an infinite error
    main(sys.argv[1], Path(sys.argv[2]))
