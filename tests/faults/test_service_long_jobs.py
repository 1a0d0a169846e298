"""A job that would run for days: other jobs run meanwhile, and it ends at its limit of run time."""

import json

import pytest

from support.service_processes import serving

pytestmark = pytest.mark.nightly

#: Enough generations for days.
ENDLESS = 1_000_000

#: Limit of run time in seconds, longer than the short job takes on a busy machine.
LIMIT = 40


def test_long_job_leaves_room_for_others_and_ends_with_its_models(tmp_path):
    environment = {"ISLANDS_MAX_RUN_SECONDS": str(LIMIT)}
    with serving(tmp_path / "data", "--coordinators", 2, environment=environment) as service:
        endless = service.submit(ENDLESS)
        service.under_way(endless)
        short = service.ended(service.submit(3))
        assert short["state"] == "succeeded"
        running = service.job(endless)
        assert (running["state"], running["max_run_seconds"]) == ("running", LIMIT)
        ended = service.ended(endless)
        assert ended["state"] == "succeeded"
        assert LIMIT <= ended["run_seconds"] < LIMIT + 20
        assert ended["summary"]["ended_by"] == "run time"
        assert "the operator can raise the limit" in ended["summary"]["note"]
        assert len(json.loads(service.models(endless))["items"]) == ended["summary"]["models"]
