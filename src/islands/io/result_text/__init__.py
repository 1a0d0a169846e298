"""Text of a result for readers: the summary of the recommended model, and the method."""
