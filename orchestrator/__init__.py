"""Scenario, graph, masters, reference, results: everything above the modules."""
