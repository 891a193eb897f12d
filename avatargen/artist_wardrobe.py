"""The artist-made wardrobe's own people by seed, as avatars."""

from collections.abc import Mapping

from avatargen import __version__
from avatargen.avatar import Avatar
from avatargen.avatar_info import AvatarInfo
from avatargen.wardrobe.makehuman.borrow import borrow
from avatargen.wardrobe.makehuman.choose import Draw, draw_latent
from avatargen.wardrobe.makehuman.person import Wardrobe
from avatargen.wardrobe.stature import stature


class ArtistWardrobe(Wardrobe):
    """A folder of MakeHuman's assets whose people are avatars: the truth that is learned."""

    def sample(self, seed: int, wear: Mapping[str, int] | None = None) -> Avatar:
        """The person of a seed, with `wear` in garments of other seeds.

        Raises:
            InputError: a seed does not wear what is borrowed of it.
        """
        draw = Draw(draw_latent(seed))
        found = borrow(self.attributes(seed), self.attributes, wear or {})
        return Avatar(
            body=self.body,
            betas=self.sizing.betas(draw.people)[0].numpy(),
            bounds=self.bounds(found),
            info=AvatarInfo(
                seed=seed,
                weights_hash="wardrobe",
                version=__version__,
                licence="CC0-1.0 (MakeHuman assets)",
                height_m=float(stature(draw.people)),
                attributes=found,
            ),
            field=self.dress(found),
        )
