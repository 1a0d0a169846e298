"""Steps of one generation: selection, variation, evaluation. Read `evaluation` first."""
