"""Many landings: what varies, what becomes of it, how probably it is safe, and maps of it."""
