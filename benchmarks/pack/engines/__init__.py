"""Engines: ours, and others that run what we export. One file each; nothing is imported here, they run in processes."""
