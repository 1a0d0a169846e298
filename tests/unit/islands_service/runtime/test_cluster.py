"""Connection to Ray."""

import os
import signal
import struct
import sys
from ipaddress import ip_address
from pathlib import Path

import pytest

from islands.progress import StoppedError
from support.processes import descendants

#: State of a socket in `/proc/net/tcp`: it listens.
LISTENING = "0A"


@pytest.mark.parametrize(
    ("resources", "reserved"), [({}, 1.0), ({"islands-jobs": 1.0}, 1.0), ({"islands-jobs": 3.0}, 0.3333)]
)
def test_processes_of_jobs_that_share_the_cores_reserve_a_fraction(monkeypatch, resources, reserved):
    """As many processes as cores of each job fit on the machine."""
    import ray

    from islands_service.runtime.cluster import reserved_cpus

    monkeypatch.setattr(ray, "cluster_resources", lambda: {"CPU": 8.0, **resources})
    assert reserved_cpus() == reserved
    assert 8 * resources.get("islands-jobs", 1.0) * reserved <= 8.0


def test_start_of_ray_that_times_out_is_reported_as_a_cluster_error(monkeypatch):
    """Ray raises a plain exception on a machine that is too busy to start it within half a minute."""
    import ray

    from islands_service.runtime import ClusterError
    from islands_service.runtime.cluster import cluster

    def time_out(**_):
        raise Exception("the current node timed out during startup")

    monkeypatch.setattr(ray, "init", time_out)
    with pytest.raises(ClusterError, match="does not start on this machine"), cluster(None):
        pass


@pytest.mark.ci
def test_local_ray_starts_no_autoscaler_log_monitor_or_dashboard(ray_address):
    """Each of them would import for a second of CPU before Ray answers."""
    (head,) = (
        pid for pid, line in descendants(os.getpid()).items() if "islands_service.runtime.ray_head" in line
    )
    lines = " ".join(descendants(head).values())
    assert "gcs_server" in lines
    assert "raylet" in lines
    for script in ("monitor.py", "log_monitor.py", "dashboard.py"):
        assert f"{script} " not in lines


@pytest.mark.ci
def test_all_ports_of_a_local_ray_listen_on_loopback(ray_address):
    """Other machines reach neither its processes, nor its workers, nor the driver."""
    from islands_service.runtime.cluster import cluster, ray

    with cluster(ray_address):
        worker = ray.remote(lambda: os.getpid()).options(num_cpus=0.1)  # noqa: PLW0108 - no built-in one
        assert ray.get(worker.remote()) in descendants(os.getpid())
        found = listening_addresses({os.getpid(), *descendants(os.getpid())})
    assert len(found) >= 6  # driver, control store, two of the raylet, agent, worker
    assert {address.is_loopback for address in found} == {True}


def listening_addresses(pids):
    """Return the addresses at which some processes listen for TCP."""
    sockets = {
        str(link.readlink())
        for pid in pids
        for link in Path(f"/proc/{pid}/fd").glob("*")
        if link.is_symlink()  # others were closed in the meantime
    }
    lines = [
        line.split()
        for name in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{name}").read_text().splitlines()
    ]
    return [
        parse_address(line[1].partition(":")[0])
        for line in lines
        if line[3] == LISTENING and f"socket:[{line[9]}]" in sockets
    ]


def parse_address(digits):
    """Return an address of `/proc/net/tcp`, which consists of words of the machine's byte order."""
    words = struct.pack(
        f"={len(digits) // 8}I", *(int(digits[at : at + 8], 16) for at in range(0, len(digits), 8))
    )
    address = ip_address(words)
    return getattr(address, "ipv4_mapped", None) or address


def end_by_rays_handler(**_options):
    """Receive SIGTERM as `ray.init` does, whose handler ends the process with the number of the signal."""
    signal.signal(signal.SIGTERM, lambda number, _frame: sys.exit(number))
    signal.raise_signal(signal.SIGTERM)


@pytest.mark.parametrize("raises", [False, True])
def test_sigterm_during_the_start_of_ray_reaches_the_handler_of_the_caller(monkeypatch, raises):
    import ray

    from islands_service.runtime import cluster

    received = []

    def receive(number, _frame):
        received.append(number)
        if raises:
            raise KeyboardInterrupt

    monkeypatch.setattr(ray, "init", end_by_rays_handler)
    before = signal.signal(signal.SIGTERM, receive)
    try:
        with pytest.raises(KeyboardInterrupt if raises else StoppedError), cluster.cluster(cpus=1):
            pass
        assert received == [signal.SIGTERM]
        assert signal.getsignal(signal.SIGTERM) is receive
    finally:
        signal.signal(signal.SIGTERM, before)
