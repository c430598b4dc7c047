"""What masters share."""
