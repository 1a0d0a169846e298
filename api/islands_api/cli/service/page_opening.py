"""Opening of the page in the browser of this machine, when the service is ready."""

import webbrowser
from threading import Thread
from time import monotonic, sleep

import httpx

from islands.cli.console import errors

#: Seconds between two checks of the service, and of all checks.
_EVERY, _TIMEOUT = 0.2, 120.0

#: Addresses on which a service listens, and at which no browser finds it.
_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}


def open_when_ready(address: str) -> Thread:
    """Open the page of a service in the browser as soon as the service answers that it is ready.

    Parameters
    ----------
    address : str
        Address of the service: scheme, host and port.

    Returns
    -------
    Thread
        The thread that waits and opens the page; the process may end without it.
    """
    scheme, _, place = address.partition("://")
    host, _, port = place.rpartition(":")
    host = _EVERYWHERE.get(host, host)
    page = f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/"
    thread = Thread(target=_open, args=(page,), name="open the page", daemon=True)
    thread.start()
    return thread


def _open(page: str) -> None:
    if not _wait_until_ready(f"{page}readyz"):
        errors.print(f"the service is not ready: open {page} later", markup=False)
    elif not webbrowser.open(page):
        errors.print(f"this machine has no browser: open {page}", markup=False)


def _wait_until_ready(url: str) -> bool:
    end = monotonic() + _TIMEOUT
    # The certificate of a service on this machine may be valid for its public name alone.
    with httpx.Client(verify=False, trust_env=False) as client:
        while monotonic() < end:
            try:
                if client.get(url).is_success:
                    return True
            except httpx.TransportError:
                pass  # The service does not listen yet.
            sleep(_EVERY)
    return False
