"""Blocking operations run in a thread with the context of their request and are never abandoned."""

import asyncio
import threading
from collections.abc import Iterator
from contextvars import ContextVar

import pytest

from islands_api.web.concurrency import BlockingExecutor

request_name: ContextVar[str] = ContextVar("request_name", default="")


@pytest.fixture
def executor() -> Iterator[BlockingExecutor]:
    opened = BlockingExecutor()
    yield opened
    opened.close()


def test_an_operation_has_the_context_of_its_request(executor: BlockingExecutor) -> None:
    """Log entries of an operation have the id of its request."""

    async def send(name: str) -> str:
        request_name.set(name)
        await asyncio.sleep(0)
        return await executor.run(request_name.get)

    async def send_all() -> list[str]:
        return await asyncio.gather(*(send(name) for name in "abc"))

    assert asyncio.run(send_all()) == ["a", "b", "c"]


def test_a_cancelled_request_waits_for_its_operation(executor: BlockingExecutor) -> None:
    """Files that the operation uses are closed only afterwards."""
    started, resume, ended = threading.Event(), threading.Event(), threading.Event()

    def operation() -> None:
        started.set()
        resume.wait(10.0)
        ended.set()

    async def cancel_request() -> None:
        request = asyncio.create_task(executor.run(operation))
        await asyncio.to_thread(started.wait, 10.0)
        request.cancel()
        await asyncio.sleep(0.05)
        assert not request.done()
        resume.set()
        with pytest.raises(asyncio.CancelledError):
            await request
        assert ended.is_set()

    asyncio.run(cancel_request())
