"""Closed loops of an MJCF: its equality constraints `connect` and `weld`, as tables [[loop]] (closed_loops.py).

MuJoCo computes such a constraint between two bodies from eq_data. For `connect`, these are the anchors in both bodies.
For `weld`, they are the anchor in the second body, the anchor in the first body, and the second body's quaternion
relative to the first one. Between two sites, a constraint keeps the frames of the sites together.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from psdmc.errors import InputError
from psdmc.robot.limits import shown
from psdmc.robot.mjcf_terms import Names, is_active, named

UNTURNED = (1.0, 0.0, 0.0, 0.0)


def loop_kinds(mujoco: Any) -> dict[int, int]:
    """Return the number of closed rows by the type of an equality constraint."""
    return {int(mujoco.mjtEq.mjEQ_CONNECT): 3, int(mujoco.mjtEq.mjEQ_WELD): 6}


def mjcf_loops(mujoco: Any, model: Any, names: Names, free: int | None, source: str) -> list[dict[str, Any]]:
    """Return a table for each equality constraint `connect` or `weld` that is active.

    free  the body that floats in the world; None: the robot stands

    Raises InputError if a constraint holds a body that the robot does not have.
    """
    kinds = loop_kinds(mujoco)
    world = names.body(0) if free is None else "universe"
    found = []
    for k in range(model.neq):
        if not is_active(mujoco, model, k) or int(model.eq_type[k]) not in kinds:
            continue
        name = named(mujoco, model, "EQUALITY", k) or f"equality{k}"
        ends = list(_ends(mujoco, model, k))
        root = 0 if free is None else int(model.body_rootid[free])
        outside = [body for body, _, _ in ends if body and root and int(model.body_rootid[body]) != root]
        if outside:
            raise InputError(
                f"{source}: equality constraint {shown(name)} holds body {shown(names.body(outside[0]))} of no robot",
                'write active="false" there',
            )
        first, second = (
            {
                "link": names.body(body) if body else world,
                "xyz": place.tolist(),
                "quaternion": np.roll(turn, -1).tolist(),
            }
            for body, place, turn in ends
        )
        found.append({"name": name, "rows": kinds[int(model.eq_type[k])], "first": first, "second": second})
    return found


def _ends(mujoco: Any, model: Any, k: int) -> Iterator[tuple[int, Any, Any]]:
    """Body, position and quaternion (w, x, y, z) of both frames in their bodies."""
    data = model.eq_data[k]
    is_weld = model.eq_type[k] == mujoco.mjtEq.mjEQ_WELD
    for number, place in zip(
        (int(model.eq_obj1id[k]), int(model.eq_obj2id[k])),
        (data[3:6], data[:3]) if is_weld else (data[:3], data[3:6]),
        strict=True,
    ):
        if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE:
            yield int(model.site_bodyid[number]), model.site_pos[number], model.site_quat[number]
        else:
            is_turned = is_weld and number == int(model.eq_obj1id[k])
            yield number, place, data[6:10] if is_turned else np.array(UNTURNED)
