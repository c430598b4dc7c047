"""Components and connections, checked once."""
