"""Charts and the pictures on them."""
