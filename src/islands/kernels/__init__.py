"""Numba kernels on bare arrays: no domain names, no allocation per sample, every sum in a fixed order.

Read `simd` (vector type) and `interpreter` (programs) first, then `simulate` and `population`.
"""
