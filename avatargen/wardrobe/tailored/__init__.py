"""Garments sewn in code: patterned on the canonical body's own surface, eased, draped and painted.

form -> cutting -> draping -> flaring -> pieces -> painting -> collection
"""
