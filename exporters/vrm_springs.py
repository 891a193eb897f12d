"""An asset's springs and colliders as VRM's spring bones, VRMC_springBone 1.0."""

from assets.asset.asset import Asset
from assets.asset.spring import Collider, Spring

EXTENSION = "VRMC_springBone"
GROUP = "body"
DIGITS = 6


def spring_bones(asset: Asset) -> dict[str, object]:
    """The extension's content: capsules, one group of them all, and a spring for each chain. Joint j is node
    j of the file."""
    return {
        "specVersion": "1.0",
        "colliders": [collider(each) for each in asset.colliders],
        "colliderGroups": [{"name": GROUP, "colliders": list(range(len(asset.colliders)))}],
        "springs": [spring(each) for each in asset.springs],
    }


def collider(of: Collider) -> dict[str, object]:
    """A capsule at its joint's node."""
    offset, tail = (point.round(DIGITS).tolist() for point in (of.offset, of.tail))
    return {
        "node": of.joint,
        "shape": {"capsule": {"offset": offset, "tail": tail, "radius": round(of.radius, DIGITS)}},
    }


def spring(of: Spring) -> dict[str, object]:
    """A chain from its first joint to its end."""
    joints = [
        {
            "node": int(joint),
            "hitRadius": of.radius,
            "stiffness": of.stiffness,
            "gravityPower": of.gravity,
            "gravityDir": [0.0, -1.0, 0.0],
            "dragForce": of.drag,
        }
        for joint in of.joints
    ]
    return {"name": of.name, "joints": joints, "colliderGroups": [0]}
