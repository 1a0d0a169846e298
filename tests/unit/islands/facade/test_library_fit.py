"""Fit of one library: its certificates, and the libraries to which its model belongs."""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from islands.facade.fit_settings import FitSettings
from islands.facade.library_fit import fit_library
from islands.facade.trials.library import take_library
from islands.facade.trials.prepared_data import PreparedData
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.records.split import split_data
from support.portfolio_records import KINDS


def test_a_better_subset_of_the_certificates_is_fitted():
    record, _ = replace(KINDS["backlash"], samples=400).record(2)
    library = take_library("phi-polynomial", None, None, None)
    data, settings = PreparedData(split_data(record, 0.25)), FitSettings(max_terms=5, certificate=2000)
    fit = fit_library(record, data, library, settings, 0, Steps())
    found = []

    def refit(steps, subsets):
        found.append((subsets, fit.refit(steps, subsets)))
        return found[-1][1]

    certified = replace(fit, refit=refit).certify()
    ((subsets, again),) = found
    best = [each.structure for each in certified.found.search.certificates.values()]
    assert [list(each) for each in subsets] == [best]
    assert best != list(fit.subsets[0])
    assert [each.model for each in certified.found.models] == [each.model for each in again.found.models]
    certificates = replace(again, refit=None).certify().found.search.certificates
    assert certificates == certified.found.search.certificates


def test_a_model_is_within_each_library_that_has_its_terms():
    rng = np.random.default_rng(0)
    u = rng.uniform(2.0, 3.0, 200)
    y = lfilter([0.0, 0.2], [1.0, -0.8], u) + 7.0
    record = Dataset(u, y + 1e-3 * rng.standard_normal(200), 0.1)
    settings = FitSettings(max_terms=3, certificate=0, estimator="extended-least-squares", average=1)
    library = take_library("magnitude", 1, 1, None)
    fit = fit_library(record, PreparedData(split_data(record, 0.25)), library, settings, 0, Steps())
    model = fit.found.recommended.model
    assert fit.contains(model, take_library("polynomial", 1, 1, None))
    assert not fit.contains(model, take_library("phi-polynomial", 2, 2, None))
