"""The modules: cable, robot and contact, each a variable table and pure kernels on flat arrays."""
