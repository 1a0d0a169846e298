"""Numba kernels on bare arrays: no domain names, no allocation per sample, every sum in a written order."""
