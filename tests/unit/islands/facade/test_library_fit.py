"""Fit of one library: the certificates are those of a fit that starts from their subsets."""

from dataclasses import replace

from islands.facade.fit_settings import FitSettings
from islands.facade.library_fit import fit_library
from islands.facade.trials.library import take_library
from islands.records.split import split_data
from support.portfolio_records import KINDS


def test_a_better_subset_of_the_certificates_is_fitted():
    record, _ = replace(KINDS["backlash"], samples=400).record(2)
    library = take_library("phi-polynomial", None, None, None)
    fit = fit_library(record, split_data(record, 0.25), library, FitSettings(max_terms=5, certificate=2000))
    found = []

    def refit(subsets):
        found.append((subsets, fit.refit(subsets)))
        return found[-1][1]

    complete = replace(fit, refit=refit).complete()
    ((subsets, again),) = found
    certified = [each.structure for each in complete.search.certificates.values()]
    assert [list(each) for each in subsets] == [certified]
    assert certified != list(fit.subsets[0])
    assert [each.model for each in complete.models] == [each.model for each in again.found.models]
    assert replace(again, refit=None).complete().search.certificates == complete.search.certificates
