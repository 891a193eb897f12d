"""Pictures of assets."""
