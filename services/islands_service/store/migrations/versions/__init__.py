"""Schema revisions in the order of their numbers; `upgrade.HEAD` names the last one."""
