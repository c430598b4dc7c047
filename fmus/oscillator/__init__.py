"""A mass between springs: the smallest thing to couple, with an analytic solution."""
