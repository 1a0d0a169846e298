"""Results of a diagnosis, plans and states of monitoring as JSON, and as text for readers."""
