"""Contact of a grooved wheel with the cable: the law, its exchange over a macro step, the module."""
