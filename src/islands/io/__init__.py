"""Reading and writing files: records, models, checkpoints and results.

Start with `records` (measured data) and `models` (model files).
"""
