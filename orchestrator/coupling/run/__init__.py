"""Running a master over a graph, and what is kept of it."""
