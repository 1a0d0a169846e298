"""Counts of what owners have in progress."""

from contextlib import ExitStack

import pytest

from islands_api.web.limits.owner_counts import OwnerCounts
from islands_service.domain.job import QuotaError


def test_each_owner_has_its_own_count_until_the_end_of_the_block():
    counts = OwnerCounts("event streams")
    for _ in range(2):
        with ExitStack() as stack:
            for owner in "aab":
                stack.enter_context(counts.count(owner, 2))
            with pytest.raises(QuotaError, match="2 event streams of this owner"), counts.count("a", 2):
                pass
            stack.enter_context(counts.count("b", 2))


def test_a_quota_of_zero_refuses_everything():
    with pytest.raises(QuotaError), OwnerCounts("event streams").count("a", 0):
        pass
