"""A pendulum of 0.5 m as a DH table, whose dynamics anybody can write down."""


def pendulum(mass: float, x: float, yy: float, zz: float) -> str:
    """TOML: the centre of mass is at `x` on the way from the tip, `yy` and `zz` are the inertia about it."""
    return f"""
name = "pendulum"
convention = "standard"
gravity = [0.0, -9.81, 0.0]
[[joint]]
name = "pivot"
type = "revolute"
a = 0.5
alpha = 0.0
d = 0.0
theta = 0.0
[joint.link]
mass = {mass}
com = [{x}, 0.0, 0.0]
inertia_com = {{ xx = {yy}, yy = {yy}, zz = {zz}, xy = 0.0, xz = 0.0, yz = 0.0 }}
"""
