"""Files from which models, ensembles and searches are restored. Read `models` first."""
