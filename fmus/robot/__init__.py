"""The robot: a rigid body with grooved wheels."""
