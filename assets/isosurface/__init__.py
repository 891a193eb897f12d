"""From a distance field to a closed surface."""
