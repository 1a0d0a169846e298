"""Expiry of data sets in their representation, by the retention of their owner."""

from datetime import UTC, datetime

from islands_service.coordinator.sweeper import Sweeper
from islands_service.settings import ServiceSettings
from support.service import kept, queued, spec

HOUR = 3600


def test_the_expiry_is_shown_once_a_sweep_has_found_the_data_set_idle(service):
    """In the data set, in the list, and after another upload; the owner's own retention counts."""
    settings = ServiceSettings(data_dir=service.settings.data_dir, dataset_retention=24 * HOUR)
    header = service.key("read", "write", owner="lab")
    idle, named = kept(service.store, "lab"), kept(service.store, "lab", b"2")
    queued(service.store, "lab", spec=spec(named))

    def expiries():
        items = service.client.get("/v1/datasets", headers=header).json()["items"]
        shown = {item["id"]: item["expires"] for item in items}
        for dataset, expires in shown.items():
            single = service.client.get(f"/v1/datasets/{dataset}", headers=header).json()
            assert single["expires"] == expires
        return shown

    assert expiries() == {idle: None, named: None}
    service.store.owners.change("lab", {"dataset_retention": 48 * HOUR})
    sweeper = Sweeper(settings, service.store, service.app.state.islands.blobs, -1.0)
    sweeper.sweep_if_due()
    shown = expiries()
    assert shown[named] is None
    left = datetime.fromisoformat(shown[idle]) - datetime.now(UTC)
    assert 48 * HOUR - 120 < left.total_seconds() <= 48 * HOUR
    service.store.owners.change("lab", {"dataset_retention": 0})
    assert expiries() == {idle: None, named: None}
