"""The cable: gradient-deficient ANCF Euler–Bernoulli elements, statics and dynamics."""
