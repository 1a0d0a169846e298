"""Records of measured or simulated data: signals on a time grid, their files, and facts about them.

Read `dataset` first, then `reading` (files and frames) and `inspection`.
"""
