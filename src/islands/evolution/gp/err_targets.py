"""Table of targets of the error reduction ratio (ERR) by which pruning removes terms."""

from collections.abc import Mapping
from types import MappingProxyType

#: Whether the ERR refers to increments of the output in the null space of the constraints, by name. The paper
#: refers it to y(k). On an oversampled record y(k-1) explains nearly all of y(k), so that pruning with the
#: paper's tolerance leaves one or two terms of any model.
ERR_TARGETS: Mapping[str, bool] = MappingProxyType({"output": False, "increment": True})
