"""The revisions, in the order of their numbers; ``HEAD`` in `islands_service.store.schema` names the last."""
