"""Random trees whose joints follow others, as URDFs that Pinocchio reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from random_trees import RandomTree

from psdmc.robot.coordinates import Coordinate

TRUNK = (
    '<inertial><origin xyz="0.1 0 -0.05"/><mass value="6"/>'
    '<inertia ixx="0.2" iyy="0.3" izz="0.25" ixy="0.01" ixz="0" iyz="-0.02"/></inertial>'
)

FOOT = (
    '<link name="foot{i}"/><joint name="to_foot{i}" type="fixed"><parent link="link{i}"/><child link="foot{i}"/>'
    '<origin xyz="0.2 -0.1 0.3" rpy="0.4 -0.7 1.1"/></joint>'
)


def as_urdf(tree: RandomTree, coordinates: Sequence[Coordinate]) -> str:
    """The tree with its mimic joints, numbers to all their digits."""

    def words(values) -> str:
        return " ".join(repr(float(value)) for value in values)

    parts = ['<robot name="tree"><link name="base"/>']
    for i, (joint, parent, place) in enumerate(zip(tree.types, tree.parents, tree.places, strict=True)):
        body, coordinate = pin.Inertia.FromDynamicParameters(tree.parameters[i].copy()), coordinates[i]
        names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        six = " ".join(
            f'{name}="{float(value)!r}"'
            for name, value in zip(names, body.inertia[np.triu_indices(3)], strict=True)
        )
        above = "base" if parent < 0 else f"link{parent}"
        mimic = (
            f'<mimic joint="joint{coordinate.leader}" multiplier="{coordinate.ratio!r}" offset="{coordinate.offset!r}"/>'
            if coordinate != Coordinate(i)
            else ""
        )
        parts.append(
            f'<link name="link{i}"><inertial><origin xyz="{words(body.lever)}"/><mass value="{body.mass!r}"/>'
            f"<inertia {six}/></inertial></link>"
            f'<joint name="joint{i}" type="{joint.word}"><axis xyz="0 0 1"/>{mimic}'
            f'<parent link="{above}"/><child link="link{i}"/>'
            f'<origin xyz="{words(place.translation)}" rpy="{words(pin.rpy.matrixToRpy(place.rotation))}"/>'
            '<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def placed(model: pin.Model, data: pin.Data, link: str, world: pin.SE3) -> dict[str, object]:
    """A frame of a loop, in a link, that is where `world` is."""
    place = world
    if model.existFrame(link) and link != "universe":
        place = data.oMf[model.getFrameId(link)].inverse() * world
    return {
        "link": link,
        "xyz": place.translation.tolist(),
        "rpy": pin.rpy.matrixToRpy(place.rotation).tolist(),
    }
