"""Contact of a grooved wheel with the cable: the law at one instant, its exchange over a macro step, the module."""
