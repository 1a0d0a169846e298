"""Admission of uploads: limits per owner and in total, and bytes that uploads in progress reserve."""

import pytest

from islands_api.web.uploads.admission import UploadAdmission
from islands_service.domain.job import QuotaError


def test_reservations_of_an_owner_add_up_to_the_quota_at_most():
    admission = UploadAdmission(9)
    with admission.reserve("a", 0, 70, 20, 100) as first, admission.reserve("a", 0, 70, 20, 100) as second:
        assert (first, second) == (70, 10)
        with pytest.raises(QuotaError, match="delete some"), admission.reserve("a", 1, 1, 20, 100):
            pass
        with admission.reserve("b", 100, 100, 0, 100) as other:
            assert other == 100
