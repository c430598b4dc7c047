"""What the workers of a batch have in common, loaded once: a module a solver, imported by the process they are forked from.

A worker that is forked from there has its libraries and kernels at once, one in the place of a worker that has died, too.
"""
