"""MakeHuman's clothes, hair, brows, lashes, eyes and skins, read from a folder of the user's and fitted to
the canonical body. No asset comes with the package; what fitting needs of MakeHuman's base mesh does.
"""
