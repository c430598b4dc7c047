"""Scenarios written for other tools: SSP 1.0, and the system structure of the Open Simulation Platform."""
