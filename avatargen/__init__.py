"""AvatarGen: a generative model of clothed, animatable people, and the fields it gives."""

__version__ = "0.1.0"
