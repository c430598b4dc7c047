"""The monolithic reference: the modules' own kernels solved as one system."""

from __future__ import annotations

from orchestrator.landing.monolithic.solve import Problem, Solution, solve

__all__ = ["Problem", "Solution", "solve"]
