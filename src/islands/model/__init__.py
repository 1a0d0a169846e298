"""The algebra of models: primitives, expressions, regressors, clusters, models and their text."""
