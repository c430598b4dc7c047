"""Scenario files: TOML to types, once."""
