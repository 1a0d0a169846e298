"""Schema revisions, each named by the release that made it; `upgrade.HEAD` names the last one."""
