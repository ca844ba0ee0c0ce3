"""Finds the robot with which a model is compared: the robot file from which the model was derived. Chooses parameters
that both the model and this robot can have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_parameters import random_parameters
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array, Mechanism


def source_of(model: DynamicsModel) -> LoadedRobot:
    """Return the robot from which the model was derived, read again from the source text that the model contains."""
    kept = model.provenance
    if not {"source_text", "source_format", "options"} <= set(kept):
        raise InputError(f"the model of '{model.mechanism.name}' holds no source", "give the robot's file")
    name = str(kept.get("source_name", "robot"))
    return load_robot_text(kept["source_text"], kept["source_format"], source_name=name, **kept["options"])


def with_passive_joints(model: DynamicsModel, loaded: LoadedRobot) -> LoadedRobot:
    """Return the source with the passive joints of the model, which `derive` may have chosen."""
    pairs = zip(loaded.mechanism.loops, model.mechanism.loops, strict=False)
    loops = tuple(replace(loop, passive=own.passive) for loop, own in pairs)
    return replace(loaded, mechanism=replace(loaded.mechanism, loops=loops)) if loops else loaded


def require_same_robot(model: DynamicsModel, loaded: LoadedRobot) -> None:
    """Raise InputError if the joints or links of the source differ from those of the model."""
    found, expected = loaded.mechanism, model.mechanism
    for what, there, here in (
        ("joints", found.joint_names, expected.joint_names),
        ("links", _links(found), _links(expected)),
    ):
        if there != here:
            raise InputError(
                f"{loaded.source_name} has {what} {', '.join(there)}, the model has {', '.join(here)}",
                "give the file, base and tip that the model was derived from",
            )


def _links(mechanism: Mechanism) -> tuple[str, ...]:
    return tuple(joint.link_name for joint in mechanism.joints)


def compared_parameters(model: DynamicsModel, loaded: LoadedRobot) -> tuple[Array, Array | None]:
    """Return the base parameters theta_b (l,) and the standard parameters (n, 11) with which the model and Pinocchio
    are compared. None instead of the standard parameters means those of the source."""
    if model.theta_b is not None:
        theta = np.asarray(model.theta_b)
        for known in (loaded.mechanism.parameters, model.mechanism.parameters):
            if _gives(theta, model.B, known):
                return theta, None if known is loaded.mechanism.parameters else known
    x = random_parameters(model.mechanism)
    return model.B @ x, x.reshape(model.n, PARAMETERS_PER_LINK)


def _gives(theta: Array, B: Array, parameters: Array) -> bool:
    """Whether standard parameters (n, 11) are known and have these base parameters."""
    if np.isnan(parameters).any():
        return False
    return bool(np.allclose(B @ parameters.reshape(-1), theta, rtol=1e-9, atol=1e-12))
