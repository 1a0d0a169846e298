"""Steps of one generation: selection, variation and evaluation."""
