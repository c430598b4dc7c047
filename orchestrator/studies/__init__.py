"""Studies: many landings held against what a paper or a measurement says."""
