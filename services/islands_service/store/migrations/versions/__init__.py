"""Schema revisions in the order of their numbers; `schema_upgrade.HEAD` names the last one."""
