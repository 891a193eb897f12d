"""One seed of many, in a worker: everything that seeds share is loaded once."""

import hashlib
import time
import warnings
from argparse import Namespace

from avatargen.atomic import write_together
from avatargen.commands.export.manifest import Row
from avatargen.commands.export.run import Clock, encoding_of, make_avatar, open_workshop
from avatargen.commands.export.scenes import SCENES
from avatargen.errors import AvatarGenError
from exporters import encode, find_format
from exporters.export import require_encoding


class SeedExporter:
    """Writes DIR/avatar_SEED.FORMAT, seed after seed.

    Raises AvatarGenError for options and files that would fail every seed.
    """

    def __init__(self, given: Namespace) -> None:
        warnings.simplefilter("ignore")
        self.given, self.format = given, given.format or SCENES[given.scene].format
        require_encoding(f"avatar.{self.format}", encoding_of(given))
        self.workshop = open_workshop(given, find_format(f"avatar.{self.format}"))

    def export(self, seed: int) -> Row:
        """Make and write one avatar, or say why there is none."""
        started = time.perf_counter()
        path = self.given.out / f"avatar_{seed}.{self.format}"
        try:
            made = make_avatar(self.workshop, seed, Clock(lambda doing, share: None))
            files = encode(made.asset, path, encoding_of(self.given))
            write_together(files)
        except (AvatarGenError, MemoryError) as error:
            reason = str(error) or type(error).__name__
            return Row(seed=seed, error=reason, seconds=round(time.perf_counter() - started, 3))
        return Row(
            seed=seed,
            file=path.name,
            sha256=hashlib.sha256(dict(files)[path]).hexdigest(),
            bytes=sum(len(data) for _, data in files),
            faces=len(made.asset.faces),
            error_mm=made.report.error.facts(),
            seconds=round(time.perf_counter() - started, 3),
        )
