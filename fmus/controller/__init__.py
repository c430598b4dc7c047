"""A controller that brings a robot down on a line and sets it down there."""
