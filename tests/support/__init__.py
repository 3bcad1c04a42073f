"""What test modules use in common."""
