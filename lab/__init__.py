"""Laboratory: measurements of the project, which a checkout has and the package does not.

``README.md`` lists them. They use the records and processes of ``tests/support``.
"""

import sys
from pathlib import Path

_TESTS = str(Path(__file__).parents[1] / "tests")
if _TESTS not in sys.path:
    sys.path.append(_TESTS)
