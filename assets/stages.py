"""What each stage does: it reads from the draft what earlier ones have made, and adds its own. Their order is
`assets.pipeline.STAGES`."""

from functools import partial

from assets.draft import Draft
from assets.isosurface.adaptive import trace_adaptively
from assets.isosurface.extract import ExtractConfig, Extraction, trace, trace_whole
from assets.isosurface.volume import march_volume
from assets.mesh.clean import clean as clean_surface
from assets.mesh.clean import filter_by_pymeshlab
from assets.mesh.measure import missed_error, surface_error
from assets.simplify.reduce import reduce, refit
from assets.simplify.simplify import SimplifyConfig
from assets.simplify.simplify import simplify as simplify_surface
from assets.skin.attach import attach
from assets.skin.hang import hang
from assets.skin.rest import to_rest
from assets.skin.skin import SkinConfig, skin_attached
from assets.texture.bake import BakeConfig, bake_texture
from assets.texture.normal_map import bake_normals
from assets.texture.occlusion import bake_occlusion, distance_to

SEEDS = 32  # cells along the bounds' longest side at which the search ends: of all pieces the largest is kept
PART_ROUNDS = 2  # of smoothing the weights of a part
# metres: what a loop goes around that is longer is meant to be there. On a person hands pass through no
# hole; on a part of one straps and belt loops are handles
HANDLES, PART_HANDLES = 0.6, 0.02
MORE_SEEDS = 128  # where others stay, too: a sock, a hat


def extract(draft: Draft) -> None:
    """The zero level. The adaptive mesher is as coarse as the faces left allow; where all are kept it is
    exact, as marching cubes always are."""
    draft.extraction = find_surface(draft)


def clean(draft: Draft) -> None:
    """One closed piece, or the few that stay. pymeshlab's recipe has its filters first; what these leave is
    repaired here too."""
    surface = draft.extraction.surface
    if draft.config.simplifier == "pymeshlab":
        surface = filter_by_pymeshlab(surface)
    draft.cleaning = clean_surface(surface, draft.least_piece)
    draft.surface = draft.cleaning.surface


def simplify(draft: Draft) -> None:
    """The adaptive simplifier asks the field where its faces belong. pymeshlab and fast-simplification know
    the mesh alone: who asks for them gets what they make of it, laid on the field neither before nor
    after, and every handle."""
    faces, simplifier = draft.config.faces, draft.config.simplifier
    assert faces is not None, "planned without a number of faces"
    if simplifier == "adaptive":
        longest = HANDLES if draft.follow is None else PART_HANDLES
        draft.surface = reduce(draft.surface, draft.avatar.sdf, faces, draft.importance, longest)
    else:
        collapses = SimplifyConfig(target_faces=faces, simplifier=simplifier)
        draft.surface = simplify_surface(draft.surface, collapses)


def charts(draft: Draft) -> None:
    """Begins to cut them: faces are final now, and vertices move half a millimetre at most as a rule."""
    assert draft.charting is not None, "planned without charts"
    draft.charting.begin(draft.surface, draft.body, draft.config)


def fit(draft: Draft) -> None:
    draft.surface = refit(draft.surface, draft.avatar.sdf)


def skin(draft: Draft) -> None:
    """Weights to the T-pose, and from there on; what is hidden has those of what hides it."""
    draft.attachment = attachment = attach(draft.surface, draft.body)
    # a garment is filled at each of its ends, and smoothed around them sleeves would leave their arms
    config = SkinConfig() if draft.follow is None else SkinConfig(smoothing_rounds=PART_ROUNDS)
    draft.skin = skin_attached(attachment, draft.body, config)
    draft.moved = hang(draft.skin, draft.surface, draft.body)
    if draft.follow is not None:
        draft.moved, _ = draft.follow(draft.surface, draft.moved, attachment, True)
        draft.skin, draft.attachment = draft.follow(draft.surface, draft.skin, attachment, False)


def measure(draft: Draft) -> None:
    draft.error = surface_error(draft.surface, draft.avatar.sdf)
    if draft.config.faces is not None:
        draft.missed = missed_error(draft.surface, draft.cleaning.surface)


def rest(draft: Draft) -> None:
    betas, on_ground = draft.avatar.betas, draft.config.on_ground
    draft.rest = to_rest(
        draft.surface,
        draft.skin,
        draft.attachment,
        draft.body,
        betas,
        draft.rotations,
        on_ground,
        draft.moved,
    )


def atlas(draft: Draft) -> None:
    """Waits for the charts."""
    assert draft.charting is not None, "planned without charts"
    draft.atlas = draft.charting.result()


def bake(draft: Draft) -> None:
    size = square(draft.config.texture)
    draft.texture = bake_texture(draft.surface, draft.charted, draft.avatar.color, size)


def normals(draft: Draft) -> None:
    size = square(draft.config.normal_map)
    draft.normal_map = bake_normals(draft.surface, draft.rest, draft.charted, draft.avatar.sdf, size)


def occlusion(draft: Draft) -> None:
    size = square(draft.config.ambient_occlusion)
    draft.occlusion = bake_occlusion(draft.surface, draft.charted, distance_to(draft.surface), size)


def square(texels: int | None) -> BakeConfig:
    """A picture of so many texels along a side."""
    assert texels is not None, "planned without this picture"
    return BakeConfig(texture_size=texels)


def find_surface(draft: Draft) -> Extraction:
    """The avatar's surface, in larger bounds where it leaves its own."""
    config, way = draft.config, trace
    if config.mesher == "marching-cubes":
        way = partial(trace, march=march_volume)
    elif config.faces is not None:
        way = partial(trace_adaptively, faces=config.faces, importance=draft.importance)
    seeds = SEEDS if draft.least_piece == 1 else MORE_SEEDS
    extraction = ExtractConfig(resolution=config.resolution, seeds=seeds)
    return trace_whole(draft.avatar.sdf, draft.avatar.bounds, extraction, way)
