"""Table of targets of the error reduction ratio (ERR) by which pruning removes terms."""

from collections.abc import Mapping
from types import MappingProxyType

#: Targets by name, with their codes in `islands.kernels.err_selection`: settings are read without Numba. The
#: paper refers the ERR to y(k). On an oversampled record y(k-1) explains nearly all of y(k), so that pruning
#: with the paper's tolerance leaves one or two terms of any model. ``increment`` refers it to increments of
#: the output in the null space of the constraints. ``output-single`` refers it to y(k), for each term alone:
#: without orthogonalisation, whose effect it serves to measure.
ERR_TARGETS: Mapping[str, int] = MappingProxyType({"output": 0, "increment": 1, "output-single": 2})
