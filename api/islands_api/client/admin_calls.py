"""Calls about owners: that of the caller, and, with the scope ``admin``, the jobs of all owners."""

from islands_api.client.calls import JobRef, RequestSpec, quote_id
from islands_api.client.response_parsing import read_as
from islands_api.schemas import CallerView, OwnedJobPage, OwnedJobView


def caller() -> RequestSpec[CallerView]:
    """Return the owner and the scopes of the key of this client."""
    return RequestSpec("GET", "/v1/caller", read_as(CallerView))


def admin_jobs(
    owner: str | None = None, state: str | None = None, cursor: str | None = None, limit: int = 50
) -> RequestSpec[OwnedJobPage]:
    """Return a page of the jobs of all owners, newest first.

    Parameters
    ----------
    owner, state : str, optional
        Only jobs of this owner, or in this state.
    """
    given = {"owner": owner, "state": state, "cursor": cursor, "limit": limit}
    params = {key: value for key, value in given.items() if value is not None}
    return RequestSpec("GET", "/v1/admin/jobs", read_as(OwnedJobPage), params=params)


def admin_cancel(which: JobRef) -> RequestSpec[OwnedJobView]:
    """Cancel a job of any owner. The audit trail of the service has the key of the administrator."""
    # A repetition after a lost answer would be refused, because the job is cancelled already.
    path = f"/v1/admin/jobs/{quote_id(which)}/cancel"
    return RequestSpec("POST", path, read_as(OwnedJobView), repeatable=False)
