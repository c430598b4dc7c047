"""The monolithic reference: the modules' own kernels solved as one system."""

from orchestrator.monolithic.solve import Problem, Solution, solve

__all__ = ["Problem", "Solution", "solve"]
