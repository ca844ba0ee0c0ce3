"""URDFs that tests write on the spot, from links and joints."""

from __future__ import annotations


def inertial(
    mass: object = 1.5,
    xyz: str = "0.1 -0.05 0.2",
    rpy: str = "0.3 -0.2 0.5",
    inertia: str = "0.02 0.03 0.025 0.001 -0.002 0.0015",
) -> str:
    """`inertia` is ixx iyy izz ixy ixz iyz; the last three are zero if they are left out."""
    values = [*inertia.split(), "0", "0", "0"][:6]
    entries = " ".join(
        f'i{name}="{value}"' for name, value in zip(("xx", "yy", "zz", "xy", "xz", "yz"), values, strict=True)
    )
    return f'<inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="{mass}"/><inertia {entries}/></inertial>'


INERTIAL = inertial()
BALL = inertial(1, "0 0 0", "0 0 0", "1 1 1")
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="40"/>'


def link(name: str, inside: str = INERTIAL) -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    *,
    kind: str = "revolute",
    xyz: str = "0.1 0.2 0.3",
    rpy: str = "0 0 0",
    axis: str = "0 0 1",
    extra: str = LIMIT,
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{extra}</joint>'
    )


def urdf(*parts: str, name: str = "arm") -> str:
    return f'<robot name="{name}">{"".join(parts)}</robot>'
