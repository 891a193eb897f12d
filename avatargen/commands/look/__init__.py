"""Looking at files and seeds from the command line."""
