"""What a module is: its table of variables, its recipe."""
