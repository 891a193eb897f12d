"""A sewing pattern for people: which panel each face of a surface belongs to, with seams where clothes have
them, found on any body by the names of its joints.

Panels follow the skinning weights: head, torso, arms, hands, legs, feet. Some have two sides: the head's face
and its back, the torso's front and back, a hand's palm and back, a foot's upper and sole. Arms and legs are
cut once along their inner sides, the back of the head from the neck up; palm and back of a hand stay together
along the little finger's side. The inside of clothes, which looks back at the body, and the step at a hem are
no panels but patches (`assets.texture.patches`).

Letters: V vertices of the surface, B vertices of the body, F faces, E directed edges, J joints.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from assets.errors import GeometryError
from assets.mesh.surface import Surface, directed_edges, normals_of, opposite_edges, vertex_normals
from assets.skin.attach import Attachment, attach
from assets.skin.skin import Skin, SkinConfig, connected_regions, merge_small, skin_attached
from assets.texture.patches import find_patches
from assets.texture.seams import shorten_borders, without_teeth
from avatargen.body.joints import FINGER_NAMES
from avatargen.body.model import CanonicalBody

SIDES = ("left", "right")
TORSO, HEAD = "torso", "head"
LIMBS = {
    "arm": ("shoulder", "elbow"),
    "hand": ("wrist", "hand"),
    "leg": ("hip", "knee"),
    "foot": ("ankle", "foot"),
}
NAMES = (TORSO, HEAD, *(f"{side}_{limb}" for side in SIDES for limb in LIMBS))
OTHERS = {
    HEAD: ("head", "jaw", "left_eye", "right_eye"),
    TORSO: ("pelvis", "spine1", "spine2", "spine3", "neck", "left_collar", "right_collar"),
}
NEEDED = (
    "head",
    *(f"{s}_{j}" for s in SIDES for j in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "foot")),
)
ACROSS = ("thumb", "index", "middle", "ring", "pinky")
MOST_SIDES = 3
UP = np.array([0, 1.0, 0])
FACE_DETAIL = 1.75  # texels along a line on the face for one on the rest of the head: eyes are small
SMALLEST = 40  # faces of a region of its own
MINE = 0.5  # share of a part in the weights of a body's vertex that counts as its own
SIDEWAYS = 0.9  # of a normal along x where a side seam may run
EAR = 0.15  # of the head's depth that its seam runs before the middle of its sides
SOLE = 0.6  # cosine between down and a normal that faces down
DEAREST = 17.0  # how much longer a seam counts opposite to where it is wanted
SLANTED = 0.3  # cosine to the body's normal under which a face belongs to the inside of clothes
TURNED = -0.3  # where a face beside it looks back at the body so far
FEWEST_INSIDE = 12  # faces of an inside of clothes
FEWEST = 4  # faces of what insides of clothes leave of a panel
WIDEST = 60.0  # degrees that faces of an inside's patch may be off its mean
OUTSIDE = MOST_SIDES * len(NAMES)  # numbers of panels from here on are none of the pattern's own
HINGES = 3  # edges at which the sides of a hand may hang together
STEADY = 4  # rounds of averaging normals before they are asked where they face


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Panels of a surface."""

    # `MOST_SIDES` times the part's place in `NAMES`, and its side's number; from `OUTSIDE` on, of insides
    panel: Int64[np.ndarray, " F"]
    twin: Int64[np.ndarray, " E"]
    price: Float64[np.ndarray, " V"]  # of a seam's length, 1 or more
    hinges: tuple[Int64[np.ndarray, " _"], ...]  # edges at one of which two panels hang together
    whole: Bool[np.ndarray, " F"]  # hands and face, which are to stay in one piece
    detail: Int64[np.ndarray, " F"]  # how fine texels are to be: on the body, the head, the face
    finger: Int64[np.ndarray, " F"]  # of a hand, from 1 on across it; 0 for none


def texel_scale(detail: Int64[np.ndarray, " N"], head_detail: float) -> Float64[np.ndarray, " N"]:
    """Texels along a line for one on the body, of faces or charts."""
    return np.array([1.0, head_detail, FACE_DETAIL * head_detail])[detail]


def find_pattern(surface: Surface, body: CanonicalBody) -> Pattern:
    """The pattern of a surface around the body.

    Raises:
        GeometryError: the body lacks joints that it takes.
    """
    missing = sorted(set(NEEDED) - set(body.joint_names))
    if missing:
        raise GeometryError(f"pattern: the body has no {missing[0]}; charts along seams take SMPL's joints")
    attachment = attach(surface, body)
    skin = skin_attached(attachment, body, SkinConfig())
    twin = opposite_edges(surface.faces, len(surface.vertices))
    part = merge_small(dominant_part(surface, skin, body), twin, SMALLEST)
    normals = vertex_normals(surface)
    for _ in range(STEADY):
        normals = normals + attachment.averaged(normals)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    fit = Fit(surface=surface, normals=normals, body=body)
    panel = MOST_SIDES * part
    for index, name in enumerate(NAMES):
        mine = part == index
        if mine.any():
            panel[mine] += fit.side_of(name, surface.faces[mine])
    panel = merge_small(without_teeth(panel, twin), twin, SMALLEST)
    slender = frozenset(
        (MOST_SIDES * i, MOST_SIDES * i + 1) for i, name in enumerate(NAMES) if name.endswith("hand")
    )
    panel = merge_small(shorten_borders(surface, panel, twin, slender), twin, SMALLEST)
    sides = panel
    slanted = np.where(panel == MOST_SIDES * NAMES.index(HEAD), 0.0, SLANTED)
    slanted[np.isin(panel, sum(slender, ()))] = -np.inf
    hidden = inside_of_clothes(surface, attachment, fit, slanted, twin)
    panel = merge_small(np.where(hidden, OUTSIDE, panel), twin, FEWEST)
    hidden = panel == OUTSIDE
    panel[hidden] += find_patches(surface, twin, hidden, WIDEST, FEWEST_INSIDE)
    return Pattern(
        panel=panel,
        twin=twin,
        price=fit.prices(sides),
        hinges=fit.hinges(panel, twin),
        finger=fingers_of(surface, skin, body),
        whole=np.isin(panel, [MOST_SIDES * NAMES.index(HEAD), *(each for pair in slender for each in pair)]),
        detail=np.where(sides // MOST_SIDES == NAMES.index(HEAD), 1 + (sides % MOST_SIDES == 0), 0),
    )


def inside_of_clothes(
    surface: Surface,
    attachment: Attachment,
    fit: "Fit",
    slanted: Float64[np.ndarray, " F"],
    twin: Int64[np.ndarray, " E"],
) -> Bool[np.ndarray, " F"]:
    """Faces whose normals' cosine to the body's outward normal is less than given, as of a lining and of the
    step at a hem, where some beside them look back at the body; but for a few here and there, and with others
    where only a few are not."""
    outward = np.einsum("vk,vkd->vd", attachment.barycentric, fit.body_normals[attachment.corners])
    outward = outward[surface.faces].sum(axis=1)
    normals = normals_of(surface.vertices[surface.faces])
    length = np.linalg.norm(normals, axis=1) * np.linalg.norm(outward, axis=1)
    cosine = np.einsum("fd,fd->f", normals, outward) / np.maximum(length, 1e-30)
    edge = np.flatnonzero(twin >= 0)
    region = connected_regions((cosine < slanted).astype(np.int64), edge // 3, twin[edge] // 3)
    turned = np.bincount(region, cosine < TURNED) > 0
    inside = (cosine < slanted) & turned[region]
    return merge_small(inside.astype(np.int64), twin, FEWEST_INSIDE) > 0


def dominant_part(surface: Surface, skin: Skin, body: CanonicalBody) -> Int64[np.ndarray, " F"]:
    """The part with most weight on each face: its place in `NAMES`."""
    weights = skin.dense(len(body.joint_names)) @ np.eye(len(NAMES))[parts_of_joints(body)]
    return weights[surface.faces].sum(axis=1).argmax(axis=1)


def parts_of_joints(body: CanonicalBody) -> Int64[np.ndarray, " J"]:
    """The part that each joint moves; one of another name belongs to its parent's, or to the torso."""
    part_of = {joint: name for name, joints in OTHERS.items() for joint in joints}
    for side in SIDES:
        part_of |= {f"{side}_{joint}": f"{side}_{limb}" for limb, joints in LIMBS.items() for joint in joints}
    part_of |= {finger: f"{finger.split('_')[0]}_hand" for finger in FINGER_NAMES}
    found: list[int] = []
    for name, parent in zip(body.joint_names, body.parents, strict=True):
        inherited = found[parent] if parent >= 0 else NAMES.index(TORSO)
        found.append(NAMES.index(part_of[name]) if name in part_of else inherited)
    return np.array(found, dtype=np.int64)


def fingers_of(surface: Surface, skin: Skin, body: CanonicalBody) -> Int64[np.ndarray, " F"]:
    """The finger with most weight on each face, 0 for none, as where the body has none."""
    finger = np.zeros(len(body.joint_names), dtype=np.int64)
    for joint, name in enumerate(body.joint_names):
        if name in FINGER_NAMES:
            finger[joint] = 1 + ACROSS.index(name.split("_")[1][:-1])
    weights = skin.dense(len(finger)) @ np.eye(1 + len(ACROSS))[finger]
    return weights[surface.faces].sum(axis=1).argmax(axis=1).astype(np.int64)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A body under a surface, as a tailor measures it."""

    surface: Surface
    normals: Float64[np.ndarray, "V 3"]  # of the surface, steadied
    body: CanonicalBody

    def joint(self, name: str) -> Float64[np.ndarray, "3"]:
        return self.body.joints[self.body.joint_names.index(name)].astype(np.float64)

    def own(self, name: str) -> tuple[Float64[np.ndarray, "B 3"], Float64[np.ndarray, "B 3"]]:
        """The body's vertices that belong to a part, and their normals; all of them where none does."""
        vertices = self.body.vertices.astype(np.float64)
        share = self.body.weights @ (parts_of_joints(self.body) == NAMES.index(name))
        mine = share > MINE if (share > MINE).any() else np.ones(len(vertices), dtype=bool)
        return vertices[mine], self.body_normals[mine]

    @cached_property
    def body_normals(self) -> Float64[np.ndarray, "B 3"]:
        return vertex_normals(Surface(vertices=self.body.vertices.astype(np.float64), faces=self.body.faces))

    def before_sides(self, name: str, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """Metres that points lie before the middle of the part's left and right sides, a line of y."""
        vertices, normals = self.own(name)
        sideways = np.abs(normals[:, 0]) > SIDEWAYS
        y, z = vertices[sideways if sideways.sum() > 1 else slice(None), 1:].T
        slope = ((y - y.mean()) * (z - z.mean())).sum() / max(((y - y.mean()) ** 2).sum(), 1e-12)
        return points[:, 2] - z.mean() - slope * (points[:, 1] - y.mean())

    def side_of(self, name: str, faces: Int64[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
        """The side of a part that each of its faces lies on."""
        points = self.surface.vertices[faces].mean(axis=1)
        facing = self.normals[faces].mean(axis=1)
        second = np.zeros(len(faces), dtype=bool)
        if name == TORSO:
            second = self.before_sides(name, points) < 0
        elif name == HEAD:
            head, _ = self.own(name)
            behind = self.before_sides(name, points) < EAR * np.ptp(head[:, 2])
            return np.where(behind, np.where(points[:, 0] > head[:, 0].mean(), 1, 2), 0)
        elif name.endswith("hand"):
            second = facing @ self.hand_axes(name)[2] < 0
        elif name.endswith("foot"):
            second = facing @ self.down(name.removesuffix("_foot")) > SOLE
        return second.astype(np.int64)

    def hand_axes(self, name: str) -> Float64[np.ndarray, "3 3"]:
        """Along a hand from the wrist, across it towards the front of the person, and out of its flat."""
        vertices, _ = self.own(name)
        axes = np.linalg.svd(vertices - vertices.mean(axis=0), full_matrices=False)[2]
        side = name.removesuffix("_hand")
        along = vertices.mean(axis=0) - self.joint(f"{side}_wrist")
        axes[0] *= np.sign(axes[0] @ along) or 1.0
        axes[1] *= np.sign(axes[1, 2]) or 1.0
        return axes

    def down(self, side: str) -> Float64[np.ndarray, "3"]:
        """Where a foot's sole faces: on from its leg, across the direction of the toes."""
        ankle, toes = self.joint(f"{side}_ankle"), self.joint(f"{side}_foot")
        leg, forward = ankle - self.joint(f"{side}_knee"), (toes - ankle) * [1, 0, 1]
        down = leg - (leg @ forward) / max(forward @ forward, 1e-12) * forward
        return down / max(float(np.linalg.norm(down)), 1e-12)

    def prices(self, panel: Int64[np.ndarray, " F"]) -> Float64[np.ndarray, " V"]:
        """1 along the inner sides of limbs and the back of the head, `DEAREST` opposite to these."""
        price = np.ones(len(self.surface.vertices))
        inward = {"left": np.array([-1.0, 0, 0]), "right": np.array([1.0, 0, 0])}
        for side in SIDES:
            arm = [self.joint(f"{side}_{joint}") for joint in ("shoulder", "elbow", "wrist")]
            leg = [self.joint(f"{side}_{joint}") for joint in ("hip", "knee", "ankle")]
            self.set_price(price, panel, f"{side}_arm", np.array(arm), np.array([0, -1.0, 0]))
            self.set_price(price, panel, f"{side}_leg", np.array(leg), inward[side])
            self.set_price(price, panel, f"{side}_foot", np.array(leg[1:]), np.array([0, 0, -1.0]))
        head, _ = self.own(HEAD)
        axis = np.stack([head.mean(axis=0), head.mean(axis=0) + UP])
        self.set_price(price, panel, HEAD, axis, np.array([0, 0, -1.0]))
        return price

    def set_price(
        self,
        price: Float64[np.ndarray, " V"],
        panel: Int64[np.ndarray, " F"],
        name: str,
        bones: Float64[np.ndarray, "N 3"],
        wanted: Float[np.ndarray, "3"],
    ) -> None:
        """Write the prices of a part: by the angle around its bones from the wanted side."""
        mine = np.unique(self.surface.faces[panel // MOST_SIDES == NAMES.index(name)])
        axis = bones[-1] - bones[0]
        length = max(float(np.linalg.norm(axis)), 1e-9)
        axis = axis / length
        points = self.surface.vertices[mine]
        place, at = (points - bones[0]) @ axis, (bones - bones[0]) @ axis
        middle = np.stack([np.interp(place, at, each) for each in bones.T], axis=1)
        off, wanted = (each - (each @ axis)[..., None] * axis for each in (points - middle, wanted))
        scale = np.linalg.norm(off, axis=1) * np.linalg.norm(wanted)
        price[mine] = 1 + (DEAREST - 1) / 2 * (1 - off @ wanted / np.maximum(scale, 1e-12))

    def hinges(
        self, panel: Int64[np.ndarray, " F"], twin: Int64[np.ndarray, " E"]
    ) -> tuple[Int64[np.ndarray, " _"], ...]:
        """Of each hand some edges from its first side to the second, on the little finger's side before the
        fingers, that where the hand is widest first."""
        found: list[np.ndarray] = []
        edges = directed_edges(self.surface.faces)
        here, there = panel[np.arange(len(twin)) // 3], panel[np.maximum(twin, 0) // 3]
        for index, name in enumerate(NAMES):
            if not name.endswith("hand"):
                continue
            first = MOST_SIDES * index
            between = np.flatnonzero((twin >= 0) & (here == first) & (there == first + 1))
            vertices, _ = self.own(name)
            points = self.surface.vertices[edges[between]].mean(axis=1) - vertices.mean(axis=0)
            along, across, _ = self.hand_axes(name) @ points.T
            before_fingers = np.flatnonzero(along < 0)
            outermost = before_fingers[np.argsort(across[before_fingers])]
            if len(outermost):
                found.append(between[outermost[:: max(1, len(outermost) // (2 * HINGES))][:HINGES]])
        return tuple(found)
