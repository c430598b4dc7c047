"""Parameters of a scenario from measurements, or from the claims of a paper."""
