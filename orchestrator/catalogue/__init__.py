"""What can be named in a scenario: modules, robots."""
