"""Multi-gene genetic programming with forward orthogonal regression (MGGP/FROE) on islands.

Read `archipelago` first, then `engine` and `search_state`.
"""
