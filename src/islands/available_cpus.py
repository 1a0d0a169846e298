"""Number of cores that this process may use, for everything that starts one process for each core."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

#: Folder of the control groups (version 2), and the file with the group of this process.
CGROUPS, MEMBERSHIP = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")


def count_cpus() -> int:
    """Return the number of cores that the affinity mask and the CPU quotas leave to this process.

    A quota is that of a container or of a systemd unit. A part of a core does not count, but there is at
    least one core.
    """
    return max(1, min([len(os.sched_getaffinity(0)), *_read_quotas()]))


def _read_quotas() -> Iterator[int]:
    """Return the quotas of the control group of this process and of those that contain it, in whole cores."""
    group = ""
    with suppress(OSError):
        lines = MEMBERSHIP.read_text().splitlines()
        group = next((line.removeprefix("0::/") for line in lines if line.startswith("0::/")), "")
    folder = CGROUPS / group
    for each in (folder, *folder.parents):
        if not each.is_relative_to(CGROUPS):
            break
        # The root has no quota; a group without a limit has the quota "max".
        with suppress(OSError, ValueError):
            quota, period = map(int, (each / "cpu.max").read_text().split())
            yield quota // period
