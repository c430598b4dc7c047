"""One FMU: its description, its binding, an instance behind fast buffers."""
