"""Quality of fits and of identifications on simulated and measured records."""
