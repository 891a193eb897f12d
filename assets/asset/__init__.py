"""What exporters are given, and what is done to it as a whole."""
