"""An MJCF file as MuJoCo itself compiles it: defaults, includes, geometry's inertias and reference positions resolved.

The compiled model is written down as a URDF of the same tree (psdmc/robot/mjcf_text.py). All that psdmc does with URDFs
then holds for it, and a model file has a source that can be read again without MuJoCo and the file's includes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psdmc.errors import InputError
from psdmc.robot.limits import shown
from psdmc.robot.mjcf_copies import refuse_many_copies
from psdmc.robot.mjcf_faults import (
    followers,
    refuse_armatures,
    refuse_constraints,
    refuse_references,
)
from psdmc.robot.mjcf_names import Names
from psdmc.robot.mjcf_notes import left_out
from psdmc.robot.mjcf_terms import gravity
from psdmc.robot.mjcf_text import tree_text
from psdmc.robot.mujoco_warnings import kept_warnings

ROOT = re.compile(r"\s*(?:<\?xml.*?\?>|<!--.*?-->|\s+)*<\s*([\w:.-]+)", re.DOTALL)
"""Up to the name of an XML text's root element."""

NOT_A_NUMBER = "NaN"
"""What MuJoCo's warning of such a number has in it."""

NO_INERTIA = "mass and inertia of moving bodies must be larger"
"""What MuJoCo says of a moving body without them."""

LEAST = 2.0**-46
"""kg, kg m^2: above MuJoCo's mjMINVAL (1e-15), and a number that no file has."""

REASON = 300
"""Characters of MuJoCo's own message that an error repeats."""


@dataclass(frozen=True, slots=True)
class MjcfRobot:
    """text: a URDF of the tree; gravity m/s^2 in the world's frame; `is_free`: the root link is on a free joint."""

    text: str
    gravity: tuple[float, float, float]
    is_free: bool


def root_tag(text: str) -> str:
    """Name of the root element of an XML text; '' where there is none."""
    found = ROOT.match(text.lstrip("\ufeff"))
    return found[1] if found else ""


def read_mjcf(path: Path, source: str) -> MjcfRobot:
    """The robot in an MJCF file.

    InputError where MuJoCo is not installed or refuses the file, and where the file has what psdmc does not model.
    """
    mujoco = _mujoco(source)
    refuse_many_copies(path, source)
    model, warned = _compiled(mujoco, path, source)
    names = Names.of(mujoco, model)
    refuse_constraints(mujoco, model, names, source)
    refuse_references(mujoco, model, names, source)
    refuse_armatures(mujoco, model, names, source)
    free = _free_root(mujoco, model, names, source)
    notes = [f"MJCF, as MuJoCo {mujoco.__version__} compiles it", *left_out(mujoco, model, names), *warned]
    follows = followers(mujoco, model, names)
    return MjcfRobot(
        tree_text(mujoco, model, names, follows, free, notes), gravity(mujoco, model), free is not None
    )


def _mujoco(source: str) -> Any:
    try:
        import mujoco
    except ImportError:
        raise InputError(
            f"{source}: an MJCF file, which MuJoCo reads, and MuJoCo is not installed",
            "pip install 'psdmc[mjcf]', or give a URDF",
        ) from None
    return mujoco


def _compiled(mujoco: Any, path: Path, source: str) -> tuple[Any, list[str]]:
    """MuJoCo's model, and notes of what it warned of."""
    try:
        with kept_warnings(mujoco) as said:
            model = _with_massless(mujoco, path)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise InputError(
            f"{source}: MuJoCo refuses it: {reason[:REASON]}",
            "files that it includes, and its meshes, must be where it says: try MuJoCo's own viewer",
        ) from None
    if any(NOT_A_NUMBER in text for text in said):
        raise InputError(f"{source}: a number of it is NaN", "write a number there")
    return model, [f"MuJoCo warns: {text[:REASON]}" for text in said]


def _with_massless(mujoco: Any, path: Path) -> Any:
    """The compiled file. MuJoCo refuses moving bodies without inertia: for the compiler those get the least that it takes,
    which is taken away again. ValueError where MuJoCo refuses the file for another reason."""
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as refused:
        if NO_INERTIA not in str(refused) or not hasattr(mujoco, "MjSpec"):
            raise
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compiler.boundmass = spec.compiler.boundinertia = LEAST
        model = spec.compile()
        bare, least = model.body_mass == LEAST, model.body_inertia == LEAST
        if (
            least.any(axis=1) & ~bare
        ).any():  # mass in a point, or none about an axis, which psdmc takes from nobody
            raise
        model.body_mass[bare], model.body_inertia[bare] = 0.0, 0.0
        return model


def _free_root(mujoco: Any, model: Any, names: Names, source: str) -> int | None:
    """The body on a free joint that all others move with; None where the robot stands."""
    free = [
        int(model.jnt_bodyid[j]) for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE
    ]
    moving = [
        b
        for b in range(1, model.nbody)
        if model.body_jntnum[b] and model.body_weldid[model.body_parentid[b]] == 0
    ]
    if not free:
        return None
    if len(moving) > 1:
        listed = ", ".join(shown(names.body(b)) for b in moving[:8])
        raise InputError(
            f"{source}: bodies {listed} move apart from each other, one of them freely: several robots",
            "leave one of them in the file",
        )
    return free[0]
