"""Kernels that modules share: compilation, banded matrices, rotations, time integration."""
