"""Connection to Ray."""

import pytest


def test_start_of_ray_that_times_out_is_reported_as_a_cluster_error(monkeypatch):
    """Ray raises a plain exception on a machine that is too busy to start it within half a minute."""
    import ray

    from islands_service.runtime.cluster import cluster
    from islands_service.runtime.errors import ClusterError

    def time_out(**_):
        raise Exception("the current node timed out during startup")

    monkeypatch.setattr(ray, "init", time_out)
    with pytest.raises(ClusterError, match="does not start on this machine"), cluster(None):
        pass
