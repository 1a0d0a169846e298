"""The Python client, for programs that wait and for those that do not. It speaks REST alone."""

from islands_api.client.asynchronous import AsyncClient
from islands_api.client.calls import JobRef
from islands_api.client.errors import ServiceError, Unreachable
from islands_api.client.synchronous import Client

__all__ = ["AsyncClient", "Client", "JobRef", "ServiceError", "Unreachable"]
