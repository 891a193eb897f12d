"""Parts of the generator of dressed people: a volume and a table for each garment, tables for the skin.

    z --choices--> skins, irises, garments, colours   of one person
    points --bounds--> the garments that can be near them --> distance and colour, laid one over another

Letters: V body vertices, F faces. Metres.
"""

import torch
from torch import Tensor, nn

from avatargen.generator.dressed.config import DressedConfig, GarmentConfig, SkinConfig
from avatargen.generator.dressed.tables import Table
from avatargen.generator.dressed.volume import Volume


class LearnedGarment(nn.Module):
    """A garment's volume, places on the cloth on the body's faces that it covers, and the body's vertices
    that it hides."""

    covered: Tensor
    hidden: Tensor

    def __init__(self, config: GarmentConfig, whole: DressedConfig) -> None:
        super().__init__()
        self.config = config
        self.volume = Volume(config.volume)
        self.places = Table(config.places)
        self.register_buffer("covered", torch.zeros(whole.face_count, dtype=torch.uint8))
        self.register_buffer("hidden", torch.zeros(whole.vertex_count, dtype=torch.uint8))


class LearnedSkin(nn.Module):
    """Skins as mixtures of the same few patterns, on tables over pieces of the body; irises seen from the
    front.

    `mixing` [skins, numbers, 3] turns a node's numbers into a skin's colour.
    """

    covered: Tensor
    mixing: Tensor
    middle: Tensor
    irises: Tensor

    def __init__(self, config: SkinConfig, whole: DressedConfig) -> None:
        super().__init__()
        self.tables = nn.ModuleList(Table(table) for table in config.tables)
        self.register_buffer("covered", torch.zeros(len(config.tables), whole.face_count, dtype=torch.uint8))
        numbers = config.tables[0].numbers
        self.register_buffer("mixing", torch.zeros(len(config.skins), numbers, 3))
        self.register_buffer("middle", torch.zeros(len(config.skins), 3))
        side = config.iris_side
        self.register_buffer("irises", torch.zeros(len(config.irises), side, side, 3, dtype=torch.uint8))
