"""Advice about an output that is flat at an extreme, as that of a saturated sensor."""

from dataclasses import replace

import numpy as np

import islands
from islands.io.result_folder import result_document
from islands.io.result_text.statements import name_statements
from support.noisy_records import make_noisy_record


def fit_document(record):
    found = islands.fit(record, library="polynomial", degree=2, lags=1, max_terms=3, average=1, certificate=0)
    return result_document(found.search_result)


def test_a_fit_to_a_saturated_output_names_the_class_of_models_with_a_limit():
    record = make_noisy_record("output", 1, 400)
    limit = float(np.quantile(record.y, 0.9))
    free, limited = map(fit_document, (record, replace(record, y=np.minimum(record.y, limit))))
    assert free["data"]["output_limits"] == [None, None]
    assert limited["data"]["output_limits"] == [None, limit]
    assert "sensor-limits" not in name_statements(free)
    assert "sensor-limits" in name_statements(limited)
