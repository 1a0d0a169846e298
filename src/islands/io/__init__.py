"""Reading and writing files: records, models, checkpoints, results and exports.

Start with `records` (measured data) and `models` (model files).
"""
