"""Data, training and evaluation from the command line."""
