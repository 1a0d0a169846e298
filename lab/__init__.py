"""Laboratory: measurements of the project, which a checkout has and the package does not.

``python -m lab`` lists the commands of the laboratory. Every other measurement is a module that states its
call: ``python -m lab.service.load store``. They use the records and processes of ``tests/support``.
"""

import sys
from pathlib import Path

_TESTS = str(Path(__file__).parents[1] / "tests")
if _TESTS not in sys.path:
    sys.path.append(_TESTS)
