"""Commands that try islands out: a demonstration, records of examples, simulated systems."""
