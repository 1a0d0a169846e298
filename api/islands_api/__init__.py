"""Web service, REST client and command line of islands. Read `web.app`, `client` or `cli` first.

>>> from islands_api import Client
>>> client = Client("http://127.0.0.1:8000")  # doctest: +SKIP
>>> job = client.submit(client.upload("piezo.csv"), inputs=["u_V"], output="y_um")  # doctest: +SKIP
>>> print(client.wait(job).summary["equation"])  # doctest: +SKIP
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from islands_api.client import AsyncClient, Client, JobFailedError, ServiceError, ServiceUnreachableError

__all__ = ["AsyncClient", "Client", "JobFailedError", "ServiceError", "ServiceUnreachableError"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # Lazy: the command line and the service do not need the client.
    return getattr(import_module("islands_api.client"), name)
