"""Listening socket: no delay of small responses, clear errors."""

import asyncio
import socket

import pytest

from islands.errors import SettingsError
from islands_api.server import listener


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_accepted_connections_send_small_responses_at_once(host: str) -> None:
    """With Nagle's algorithm each response on a kept connection takes 40 ms."""

    async def read_options() -> tuple[int, int]:
        accepted = asyncio.get_running_loop().create_future()
        with listener.open_listener(host, 0) as listening:
            server = await asyncio.start_server(lambda _, writer: accepted.set_result(writer), sock=listening)
            async with server:
                _, client = await asyncio.open_connection(*listening.getsockname()[:2])
                writer = await accepted
                connection = writer.get_extra_info("socket")
                delayed = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
                reused = listening.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR)
                for each in (client, writer):
                    each.close()
                    await each.wait_closed()
        return delayed, reused

    nodelay, reuse = asyncio.run(read_options())
    assert nodelay
    assert reuse


def test_an_address_of_another_machine_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"cannot listen at 192\.0\.2\.1, port 1234 .*as --host"):
        listener.open_listener("192.0.2.1", 1234)
