"""Admission of uploads: limits per owner and in total, and bytes that uploads in progress reserve."""

from contextlib import ExitStack, suppress

import pytest

from islands_api.web.problems import UploadLimitError
from islands_api.web.uploads.admission import UploadAdmission
from islands_service.domain.job import QuotaError


def test_uploads_are_limited_per_owner_and_in_total_until_they_end():
    admission = UploadAdmission(3)
    for _ in range(2):
        with ExitStack() as stack:
            for owner in "aab":
                stack.enter_context(admission.admit(owner, 2))
            for owner, words in (("a", "2 uploads of this owner"), ("b", "3 uploads are in progress")):
                with pytest.raises(UploadLimitError, match=words), admission.admit(owner, 2):
                    pass


def test_a_failed_upload_is_no_longer_counted():
    admission = UploadAdmission(1)
    with suppress(ZeroDivisionError), admission.admit("a", 1), admission.reserve("a", 60, 60, 0, 100):
        raise ZeroDivisionError
    with admission.admit("a", 1), admission.reserve("a", 60, 60, 0, 100) as reserved:
        assert reserved == 60


def test_reservations_of_an_owner_add_up_to_the_quota_at_most():
    admission = UploadAdmission(9)
    with admission.reserve("a", 0, 70, 20, 100) as first, admission.reserve("a", 0, 70, 20, 100) as second:
        assert (first, second) == (70, 10)
        with pytest.raises(QuotaError, match="delete some"), admission.reserve("a", 1, 1, 20, 100):
            pass
        with admission.reserve("b", 100, 100, 0, 100) as other:
            assert other == 100
