"""The FMU face of a module (pythonfmu), and the build."""
