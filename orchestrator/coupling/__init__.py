"""The co-simulation engine: FMUs, a graph of connections, masters, runs. It knows no cable, no robot and no scenario."""
