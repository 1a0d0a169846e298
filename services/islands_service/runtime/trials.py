"""Blind trials side by side on Ray."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import ray

from islands.trials.trial import Outcome, Trial, carried_out
from islands_service.runtime.cluster import cluster


def side_by_side(
    trials: Sequence[Trial], address: str | None, tell: Callable[[int], None]
) -> Iterator[Outcome]:
    """Carry out trials, each on a core; yield their outcomes in the order of the trials.

    Parameters
    ----------
    address : str or None
        ``HOST:PORT`` of a cluster; None starts a Ray on this machine.
    tell : callable
        Told how many have ended.

    Raises
    ------
    ClusterError
    """
    with cluster(address):
        task: Any = ray.remote(num_cpus=1, max_retries=3)(carried_out)
        asked = [task.remote(trial) for trial in trials]
        waiting, ended = list(asked), 0
        while waiting:
            done, waiting = ray.wait(waiting, num_returns=1)
            ended += len(done)
            tell(ended)
        yield from ray.get(asked)
