"""Genetic programming: individuals, genes, fitnesses, random streams. Read `individual` first."""
