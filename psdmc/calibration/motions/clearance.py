"""Checks which poses collide with the robot itself or with the floor. Shapes come from the URDF, and the library coal
computes distances, through Pinocchio."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import pinocchio as pin

from psdmc.calibration.logs.log import Array
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.kinematics import forward_kinematics, frame_placement
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.limits import shown, words
from psdmc.robot.mechanism import Mechanism
from psdmc.robot.urdf.dependent_joints import held_positions
from psdmc.robot.urdf.pinocchio_text import JOINT_PREFIX, dynamics_of
from psdmc.robot.urdf.read_urdf import read_urdf
from psdmc.robot.xml_text import parse_xml

APART = 0.01
"""m that shapes keep from each other: models of robots are not exact, nor do robots follow exactly."""
LARGEST_STEP = 0.02
"""rad (m) by which a joint moves, at most, between two poses that are looked at."""
FAR = 10.0
"""A path is looked at in steps this many times longer first: most that hit something are found out so."""
POSES_TRIED = 300
"""Random poses, to find the pairs that touch in every one: neighbours whose shapes overlap by design."""
FLOOR = "the floor"
FLAT = 1e-6
"""Share of a mesh's largest extent below which its smallest one is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """Pairs of collision shapes of a robot that must keep a distance from each other.

    model, shapes  Pinocchio's models of the robot and of its shapes, with the pairs
    place          (n,) index of each joint's coordinate in Pinocchio's q
    held           (nq,) Pinocchio's q, with the values of coordinates that do not belong to the n joints
    always         pairs, "A and B", that touch in every pose and are not checked
    """

    model: Any
    shapes: Any
    place: tuple[int, ...]
    held: Array
    always: tuple[str, ...] = ()
    _working: tuple[Any, Any] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        shaped = self.shapes.createData()
        for k, request in enumerate(shaped.collisionRequests):
            request.security_margin = APART
            shaped.collisionRequests[k] = request
        object.__setattr__(self, "_working", (self.model.createData(), shaped))

    def first_touch(self, q: Array, step: float = LARGEST_STEP) -> str | None:
        """Return a sentence on the first collision along a path of poses (N, n); None if there is none.

        step  rad (m) by which a joint moves, at most, between two poses that are checked
        """
        data, shaped = self._working
        for pose in itertools.chain(spread(q, FAR * step), spread(q, step)):
            whole = self.held.copy()
            whole[list(self.place)] = pose
            if pin.computeCollisions(self.model, data, self.shapes, shaped, whole, True):
                pairs = zip(self.shapes.collisionPairs, shaped.collisionResults, strict=True)
                near = next(_named(self.shapes, pair) for pair, result in pairs if result.isCollision())
                return touch(near, pose)
        return None

    @property
    def pairs(self) -> tuple[str, ...]:
        """The pairs that are checked, "A and B"."""
        return tuple(_named(self.shapes, pair) for pair in self.shapes.collisionPairs)


@dataclass(frozen=True, slots=True, eq=False)
class FloorPoints:
    """A floor for robots without collision shapes. The origins of the joints and the tip must stay above the floor.

    chain   the robot
    height  m, height of the floor above the base's origin, against gravity
    above   points that are checked: 0 to n - 1 are the origins of the n joints, n is the tip
    """

    chain: Mechanism
    height: float
    above: tuple[int, ...] = ()

    def first_touch(self, q: Array, step: float = LARGEST_STEP) -> str | None:
        """Return a sentence on the first point too close to the floor along poses (N, n); None if there is none."""
        poses = np.array(list(spread(q, step)))
        heights = self._heights(poses)[:, list(self.above)]
        low = np.argwhere(heights < self.height + APART)
        if not len(low):
            return None
        row, point = low[0]
        names = [f"the origin of joint {shown(name)}" for name in self.chain.joint_names]
        return touch(f"{[*names, 'the tip'][self.above[point]]} and {FLOOR}", poses[row])

    def _heights(self, q: Array) -> Array:
        """(N, n + 1) m above the base's origin."""
        states = [q[:, k] for k in range(q.shape[1])]
        frames = frames_of(self.chain)
        origins = [origin for _, origin in forward_kinematics(frames, states)]
        origins.append(frame_placement(frames, self.chain.tip_body, self.chain.tip, states)[1])
        size = _gravity_size(self.chain)
        up = -self.chain.gravity / size
        return np.stack(
            [sum(float(up[k]) * np.broadcast_to(origin[k], len(q)) for k in range(3)) for origin in origins],
            axis=1,
        )


def floor_points(chain: Mechanism, height: float) -> FloorPoints:
    """Return a floor, with the points that are above the floor in at least one of many random poses.

    Other points, such as the joint on which the robot stands, are not checked.
    """
    found = FloorPoints(chain, height)
    heights = found._heights(_random_poses(chain))
    return FloorPoints(
        chain, height, tuple(int(k) for k in np.flatnonzero(heights.max(axis=0) >= height + APART))
    )


def touch(pair: str, pose: Array) -> str:
    """Return a sentence that says that a pair, "A and B", comes too close at a pose (n,)."""
    angles = ", ".join(f"{value:.2f}" for value in pose)
    return f"{pair} come within {1000 * APART:g} mm of each other at q = ({angles})"


def spread(q: Array, step: float) -> Iterator[Array]:
    """Yield poses of a path (N, n), at most a step of any joint apart, with those where the motion turns."""
    if not len(q):
        return
    moved = np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0)
    way = np.concatenate([[0.0], np.cumsum(moved)])
    # a row is kept where the next one would be a step away from the last kept one
    kept = np.unique(np.concatenate([[0], np.flatnonzero(np.diff(np.floor(way / step))), [len(q) - 1]]))
    yield q[0]
    for first, last in itertools.pairwise(kept):
        count = max(1, int(np.ceil(np.abs(q[last] - q[first]).max() / step)))
        yield from (q[first] + (q[last] - q[first]) * j / count for j in range(1, count + 1))


def clearance_of(model: DynamicsModel, folders: Sequence[Path] = (), floor: float | None = None) -> Clearance:
    """Return the Clearance of a model that contains a URDF with collision shapes.

    folders  folders with its meshes
    floor    m, height of a floor above the base's origin, against gravity; None: no floor

    Raises InputError, with the reason, if there are no shapes to check.
    """
    chain, source = model.mechanism, str(model.provenance.get("source_name", "robot"))
    if model.provenance.get("source_format") != "urdf":
        raise InputError(f"{source} has no collision shapes", "derive the model from a URDF")
    if chain.has_mimic_joints:
        raise InputError(f"{source} has joints that follow others", "lock them: --lock JOINT=0")
    if not hasattr(pin, "computeCollisions"):
        raise InputError("Pinocchio was built without coal", "install the wheel pin, which has it")
    text, count = with_shapes(model.provenance["source_text"], source, folders)
    if not count:
        raise InputError(f"{source} has no collision shapes", "add <collision> to its links")
    try:
        whole = pin.buildModelFromXML(text)
        shapes = pin.buildGeomFromUrdfString(whole, text, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise InputError(
            f"{source}: its collision shapes cannot be read: {' '.join(str(error).split())}",
            "correct the file",
        ) from None
    held, place = _coordinates(whole, model, source)
    _add_pairs(whole, shapes)
    if floor is not None:
        _add_floor(whole, shapes, chain, held, floor)
    found = Clearance(whole, shapes, place, held)
    return _without_constant_pairs(found, chain)


def _coordinates(whole: Any, model: DynamicsModel, source: str) -> tuple[Array, tuple[int, ...]]:
    """q of Pinocchio's whole robot with locked joints where they are held, and the places in it of the model's joints."""
    held = np.array(pin.neutral(whole), dtype=np.float64)
    locked = (model.provenance.get("options") or {}).get("lock") or {}
    original = read_urdf(model.provenance["source_text"], source)
    for name, value in held_positions(original, locked, source).items():
        joint = whole.joints[whole.getJointId(JOINT_PREFIX + name)]
        if joint.nq == 1:
            held[joint.idx_q] = value
    ids = [whole.getJointId(JOINT_PREFIX + name) for name in model.joint_names]
    return held, tuple(whole.joints[k].idx_q for k in ids)


def _add_pairs(model: Any, shapes: Any) -> None:
    """All pairs of shapes on different bodies that no single joint connects."""
    parents = [shape.parentJoint for shape in shapes.geometryObjects]
    for a in range(len(parents)):
        for b in range(a + 1, len(parents)):
            first, second = sorted((parents[a], parents[b]))
            if first != second and model.parents[second] != first:
                shapes.addCollisionPair(pin.CollisionPair(a, b))


def _add_floor(model: Any, shapes: Any, chain: Mechanism, held: Array, height: float) -> None:
    """A half space below a plane across gravity, against all shapes that move. A mesh is above it where its convex hull
    is, and against each of a mesh's triangles the test would take a thousand times as long."""
    import coal

    data = model.createData()
    pin.framesForwardKinematics(model, data, held)
    base = data.oMf[model.getFrameId(chain.base_name, pin.FrameType.BODY)]
    up = base.rotation @ (-chain.gravity / _gravity_size(chain))
    plane = coal.Halfspace(up, float(up @ base.translation) + height)
    number = shapes.addGeometryObject(pin.GeometryObject(FLOOR, 0, pin.SE3.Identity(), plane))
    for k in range(number):
        shape = shapes.geometryObjects[k]
        if shape.parentJoint == 0:
            continue
        if (hull := _hull(shape.geometry)) is not None:
            name = f"{shape.name.rpartition('_')[0]}_hull{k}"
            k = shapes.addGeometryObject(pin.GeometryObject(name, shape.parentJoint, shape.placement, hull))
        shapes.addCollisionPair(pin.CollisionPair(k, number))


def _hull(geometry: Any) -> Any:
    """The convex hull of a mesh; None of other shapes, and of flat meshes, with whose hull coal crashes."""
    if not hasattr(geometry, "buildConvexHull"):
        return None
    points = np.array(geometry.vertices())
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if not sizes[-1] > FLAT * sizes[0]:
        return None
    geometry.buildConvexHull(True, None)
    return geometry.convex


def _without_constant_pairs(found: Clearance, chain: Mechanism) -> Clearance:
    """Without the pairs that touch in every one of many random poses, which no motion can avoid."""
    data, shaped = found.model.createData(), found.shapes.createData()
    touching = np.ones(len(found.shapes.collisionPairs), dtype=bool)
    for pose in _random_poses(chain):
        if not touching.any():
            break
        whole = found.held.copy()
        whole[list(found.place)] = pose
        pin.updateGeometryPlacements(found.model, data, found.shapes, shaped, whole)
        for k in np.flatnonzero(touching):
            touching[k] = pin.computeCollision(found.shapes, shaped, int(k))
    pairs = [found.shapes.collisionPairs[int(k)].copy() for k in np.flatnonzero(touching)]
    names = tuple(_named(found.shapes, pair) for pair in pairs)
    for pair in pairs:
        found.shapes.removeCollisionPair(pair)
    return Clearance(found.model, found.shapes, found.place, found.held, names)


def _random_poses(chain: Mechanism) -> Array:
    low = [max(joint.limits.lower, -np.pi) for joint in chain.joints]
    high = [min(joint.limits.upper, np.pi) for joint in chain.joints]
    return np.random.default_rng(0).uniform(low, high, (POSES_TRIED, len(chain)))


def _gravity_size(chain: Mechanism) -> float:
    size = float(np.linalg.norm(chain.gravity))
    if size == 0.0:
        raise InputError(f"{shown(chain.name)} has no gravity to say where the floor is", "leave --floor out")
    return size


def _named(shapes: Any, pair: Any) -> str:
    """The links that two shapes are of, "A and B"; Pinocchio puts a number behind their names."""
    names = [str(shapes.geometryObjects[k].name) for k in (pair.first, pair.second)]
    return " and ".join(
        FLOOR if name == FLOOR else f"link {shown(name.rpartition('_')[0] or name)}" for name in names
    )


SHAPES: Mapping[str, tuple[str, ...]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": ("filename", "scale"),
}
"""Shapes that a URDF may have, with their attributes."""
PLACE: tuple[str, ...] = ("xyz", "rpy")
MESH_KINDS = (".stl", ".dae", ".obj", ".ply")
LARGEST_MESH = 64 * 2**20
"""bytes of a mesh's file."""
MOST_SHAPES = 1000


def with_shapes(text: str, source: str, folders: Sequence[Path]) -> tuple[str, int]:
    """Return a URDF with the links, joints and collision shapes for Pinocchio, and the number of shapes.

    folders   folders with packages and meshes: `package://NAME/PATH` is FOLDER/NAME/PATH, or FOLDER/PATH if FOLDER is called
              NAME; other names are FOLDER/NAME

    Raises InputError if a shape cannot be used, or if its mesh is missing.
    """
    root = parse_xml(text, source, "robot")
    found = dynamics_of(root, None, {"continuous": "revolute"})
    copies = {link.get("name", ""): link for link in found.findall("link")}
    count = 0
    for link in root.findall("link"):
        for shape in link.findall("collision"):
            count += 1
            if count > MOST_SHAPES:
                raise InputError(f"{source}: more than {MOST_SHAPES} collision shapes", "leave some out")
            where = f"{source}: collision shape of link {shown(link.get('name', ''))}"
            _copy(shape, copies[link.get("name", "")], where, folders)
    return tostring(found, encoding="unicode"), count


def _copy(shape: Element, link: Element, where: str, folders: Sequence[Path]) -> None:
    copy = SubElement(link, "collision")
    origin = shape.find("origin")
    if origin is not None:
        place = {name: " ".join(words(origin.attrib[name])) for name in PLACE if name in origin.attrib}
        SubElement(copy, "origin", place)
    kinds = [child for part in shape.findall("geometry") for child in part if child.tag in SHAPES]
    if len(kinds) != 1:
        raise InputError(
            f"{where}: found {len(kinds)} shapes, expected one of {', '.join(SHAPES)}", "correct the file"
        )
    kind = kinds[0]
    given = {name: kind.attrib[name] for name in SHAPES[kind.tag] if name in kind.attrib}
    values = {name: " ".join(words(value)) for name, value in given.items() if name != "filename"}
    if kind.tag == "mesh":
        values["filename"] = str(mesh_file(given.get("filename", ""), where, folders))
    SubElement(SubElement(copy, "geometry"), kind.tag, values)


def mesh_file(name: str, where: str, folders: Sequence[Path]) -> Path:
    """Return the path of a mesh in one of the folders. Raises InputError if it is missing, no mesh, or too large."""
    plain = name.removeprefix("file://")
    package, _, inside = plain.removeprefix("package://").partition("/")
    for folder in folders if "\0" not in name else ():
        root = folder.resolve()
        tries = [root / package / inside] if "package://" in name else [root / plain]
        if "package://" in name and root.name == package:
            tries.append(root / inside)
        for path in tries:
            path = path.resolve()
            if path.is_relative_to(root) and path.is_file():
                return _checked(path, where)
    raise InputError(
        f"{where}: mesh {shown(name)} is in none of the given folders",
        "give the folder that its package is in: --meshes DIR",
    )


def _checked(path: Path, where: str) -> Path:
    if path.suffix.lower() not in MESH_KINDS:
        raise InputError(
            f"{where}: {shown(path.name)} is no mesh ({', '.join(MESH_KINDS)})", "correct the file"
        )
    size = path.stat().st_size
    if size > LARGEST_MESH:
        raise InputError(
            f"{where}: {shown(path.name)} has {size} bytes, expected at most {LARGEST_MESH}",
            "use a coarser mesh",
        )
    return path
