"""Pictures and pages, drawn from a run directory."""
