"""One seed of many, in a worker: everything that seeds share is loaded once."""

import hashlib
import time
import warnings
from pathlib import Path

from assets.asset.asset import PlainAsset
from avatargen.atomic import write_together
from avatargen.errors import AvatarGenError
from avatargen.export.manifest import Row
from avatargen.export.one import Stopwatch, make_avatar, open_workshop, silent
from avatargen.export.request import ExportRequest
from avatargen.export.sheet import draw, picture_of
from exporters import encode


class SeedExporter:
    """Writes DIR/avatar_SEED.FORMAT, seed after seed.

    Raises AvatarGenError for a request or files that would fail every seed.
    """

    def __init__(self, request: ExportRequest) -> None:
        warnings.simplefilter("ignore")
        self.workshop = open_workshop(request)

    def export(self, seed: int) -> Row:
        """Make and write one avatar, or say why there is none."""
        started, request = time.perf_counter(), self.workshop.request
        path = request.path_of(seed)
        try:
            made = make_avatar(self.workshop, seed, Stopwatch(silent))
            files = encode(made.asset, path, request.encoding)
            write_together([*self.picture(made.asset, seed), *files])
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
            height_m=made.asset.info.height_m and round(made.asset.info.height_m, 4),
            seconds=round(time.perf_counter() - started, 3),
        )

    def picture(self, asset: PlainAsset, seed: int) -> list[tuple[Path, bytes]]:
        """The person's picture for the sheet, where there is to be one."""
        request = self.workshop.request
        if request.sheet is None or request.out is None:
            return []
        return [(picture_of(request.out, seed), draw(asset))]
