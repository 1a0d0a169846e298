"""Islands on Ray: the only place that imports it. What it reads from the environment is set before that."""

import os
import sys

# Nobody's use of islands is anybody else's business.
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
# A driver that connects does not pick up by itself that the cluster asks for a token. Who has imported Ray
# before us has settled the mode of this process: processes started now have to have the same.
if "ray" not in sys.modules:
    os.environ.setdefault("RAY_AUTH_MODE", "token")
# A head that is lost ends its drivers after a minute otherwise, and nothing can be done before that.
os.environ.setdefault("RAY_gcs_rpc_server_reconnect_timeout_s", "5")
# Ray prints pages to standard output when a process is lost: our engine says it in a line, to standard error.
os.environ.setdefault("RAY_DEDUP_LOGS_SKIP_REGEX", ".")
# Ray's own choice, 15, leaves islands three per cent of a core that anybody else uses as well.
os.environ.setdefault("RAY_worker_niceness", "0")
