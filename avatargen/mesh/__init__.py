"""Tools for any points and any triangle mesh. They know no body; `avatargen` and `assets` use them."""
