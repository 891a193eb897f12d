"""avatar-export: from a seed to a file."""
