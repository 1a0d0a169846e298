"""`count_cpus`: the affinity mask and the quotas of all control groups that contain the process count."""

import os
from collections.abc import Mapping
from pathlib import Path

import pytest

from islands import available_cpus
from islands.available_cpus import count_cpus


@pytest.mark.parametrize(
    ("membership", "quotas", "cpus"),
    [
        ("", {}, 8),  # no control groups of version 2
        ("0::/", {"": "max 100000"}, 8),
        ("0::/", {"": "300000 100000"}, 3),  # in a container
        ("0::/", {"": "50000 100000"}, 1),
        ("0::/", {"": "1600000 100000"}, 8),
        ("1:cpu:/other\n0::/a.slice/b.service", {"a.slice/b.service": "200000 100000"}, 2),  # of systemd
        ("0::/a/b", {"a": "200000 100000", "a/b": "max 100000"}, 2),  # a group is bound by those around it
        ("0::/a/b", {"a": "400000 100000", "a/b": "199999 100000", "c": "100000 100000"}, 1),
        ("0::/../../outside", {"": "damaged"}, 8),
    ],
)
def test_smallest_quota_of_the_groups_of_the_process_bounds_its_cores(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    membership: str,
    quotas: Mapping[str, str],
    cpus: int,
) -> None:
    for group, quota in quotas.items():
        (tmp_path / "groups" / group).mkdir(parents=True, exist_ok=True)
        (tmp_path / "groups" / group / "cpu.max").write_text(f"{quota}\n")
    (tmp_path / "membership").write_text(membership)
    monkeypatch.setattr(available_cpus, "CGROUPS", tmp_path / "groups")
    monkeypatch.setattr(available_cpus, "MEMBERSHIP", tmp_path / "membership")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    assert count_cpus() == cpus
