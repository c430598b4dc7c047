"""A damped oscillator: a small module with every kind of variable."""
