"""A landing: from parameters and wheels to the graph of FMUs or to the monolithic problem."""
