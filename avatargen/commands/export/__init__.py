"""avatar-export: from a seed to a file."""

PROGRAM = "avatar-export"
