"""Leftovers: actors of a coordinator that lost its job and does not know it yet; they keep their CPUs."""

from contextlib import suppress

import ray


def end_leftovers(job: str, epoch: int) -> int:
    """End the actors of a job's leases before this one; return how many.

    Parameters
    ----------
    job : str
    epoch : int
        Of the lease that counts: `RayEngine` names its actors ``<job>.<epoch>.<number>``.
    """
    ended = 0
    for name in ray.util.list_named_actors():
        title, _, _ = name.rpartition(".")
        theirs, _, lease = title.rpartition(".")
        if theirs == job and lease.isdecimal() and int(lease) < epoch:
            # It may have ended by itself meanwhile.
            with suppress(ValueError):
                ray.kill(ray.get_actor(name))
                ended += 1
    return ended
