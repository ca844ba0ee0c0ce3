"""Names of bodies and joints of a compiled MJCF, those that have none given one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from psdmc.robot.names import free_name


@dataclass(frozen=True, slots=True)
class Names:
    """Names by number; `taken` are all of them."""

    bodies: tuple[str, ...]
    joints: tuple[str, ...]

    @staticmethod
    def of(mujoco: Any, model: Any) -> Names:
        bodies = [named(mujoco, model, "BODY", k) for k in range(model.nbody)]
        joints = [named(mujoco, model, "JOINT", k) for k in range(model.njnt)]
        return Names(_each_once(bodies, "body"), _each_once(joints, "joint"))

    def body(self, number: int) -> str:
        return self.bodies[int(number)]

    def joint(self, number: int) -> str:
        return self.joints[int(number)]


def named(mujoco: Any, model: Any, kind: str, number: int) -> str:
    """The file's own name of an object, '' where it has none; kind: BODY, JOINT, TENDON and so on."""
    return mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), number) or ""


def _each_once(names: list[str], kind: str) -> tuple[str, ...]:
    """The names, nameless objects called by kind and number."""
    taken = {name for name in names if name}
    return tuple(name or free_name(f"{kind}{number}", taken) for number, name in enumerate(names))
