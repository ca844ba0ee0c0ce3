"""Wrenches between a joint and the bodies beyond it, for derivatives: those that its motion requires, and its own row
A, B, C."""

from __future__ import annotations

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.joint_steps import Axis, Row, Wrench
from psdmc.dynamics.moving_composite import Composite
from psdmc.dynamics.own_axes import accelerating, axis_along, bending, composite_along, from_z, unit_twists
from psdmc.dynamics.scalar import Scalar, add, cross, scale, transform
from psdmc.dynamics.twist import combined


def torque_rows(frame: Frame, axis: Axis, composite: Composite) -> list[Row]:
    """A, B and C of each of a joint's rates about its own origin."""
    if frame.joint.about_z:
        return [torque_row(frame, axis, composite)]
    found = []
    for number, turns in unit_twists(frame.joint):
        row = _turning_row if turns else _sliding_row
        there = row(axis_along(axis, number), composite_along(composite, number))
        found.append(Row(*(from_z(v, number) for v in there)))
    return found


def torque_row(frame: Frame, axis: Axis, composite: Composite) -> Row:
    """A, B and C of a joint about its own origin."""
    turn, slide = frame.joint.turn(1.0), frame.joint.slide(1.0)
    parts = []
    if turn is not None:
        parts.append(_scaled_row(_turning_row(axis, composite), turn))
    if slide is not None:
        parts.append(_scaled_row(_sliding_row(axis, composite), slide))
    return parts[0] if len(parts) == 1 else Row(*(add(x, y) for x, y in zip(*parts, strict=True)))


def _scaled_row(row: Row, factor: float) -> Row:
    return Row(*(scale(v, factor) for v in row))


def _turning_row(axis: Axis, composite: Composite) -> Row:
    body, (p, _), _ = composite
    (hx, hy, _), (xx, yy, _, xy, xz, yz) = body.moment, body.second
    gx, gy, _ = axis.twice
    b = (
        xx * gx + xy * gy - p[0][2],
        xy * gx + yy * gy - p[1][2],
        xz * gx + yz * gy + (p[0][0] + p[1][1]),
    )
    return Row((-xz, -yz, xx + yy), b, (-hy, hx, 0.0))


def _sliding_row(axis: Axis, composite: Composite) -> Row:
    body, (_, first), _ = composite
    hx, hy, _ = body.moment
    mx, my, _ = add(first, scale(cross(axis.w, body.moment), 2.0))
    return Row((hy, -hx, 0.0), (my, -mx, 0.0), (0.0, 0.0, body.mass))


def wrenches_of_motions(
    frame: Frame, axis: Axis, composite: Composite, rates: Scalar
) -> list[tuple[Wrench, Wrench]]:
    """For each of a joint's rates what `wrenches_of_motion` says of one."""
    if frame.joint.about_z:
        return [wrenches_of_motion(frame, axis, composite)]
    found = []
    own = combined(frame.joint, rates)
    for number, turns in unit_twists(frame.joint):
        there = axis_along(axis, number), composite_along(composite, number)
        moved, pushed = (_turned_wrench, _turning_wrench) if turns else (_slid_wrench, _sliding_wrench)
        first, second = ((from_z(f, number), from_z(m, number)) for f, m in (moved(*there), pushed(*there)))
        bent = accelerating(composite.body, *bending(own, number, turns))
        found.append((first, (add(second[0], bent[0]), add(second[1], bent[1]))))
    return found


def wrenches_of_motion(frame: Frame, axis: Axis, composite: Composite) -> tuple[Wrench, Wrench]:
    """Wrenches on the composite that a joint's motion requires, per unit of q and per unit of qd."""
    turn, slide = frame.joint.turn(1.0), frame.joint.slide(1.0)
    parts = []
    if turn is not None:
        parts.append(
            (_scaled(_turned_wrench(axis, composite), turn), _scaled(_turning_wrench(axis, composite), turn))
        )
    if slide is not None:
        parts.append(
            (_scaled(_slid_wrench(axis, composite), slide), _scaled(_sliding_wrench(axis, composite), slide))
        )
    if len(parts) == 1:
        return parts[0]
    (a, b), (c, d) = parts
    return (add(a[0], c[0]), add(a[1], c[1])), (add(b[0], d[0]), add(b[1], d[1]))


def _scaled(wrench: Wrench, factor: float) -> Wrench:
    return scale(wrench[0], factor), scale(wrench[1], factor)


def _turned_wrench(axis: Axis, composite: Composite) -> Wrench:
    """Differentiate the wrench of a + U r + 2 w x r' + r'' as the composite rotates about z: z x h takes the place of
    h."""
    (_, (hx, hy, _), (xx, yy, _, xy, xz, yz)), (second, first), (force, moment) = composite
    (pxx, pxy, pxz), (pyx, pyy, pyz), (pzx, pzy, _) = second
    (wx, wy, wz), (u, differences) = axis.w, axis.spin
    h, p = (-hy, hx, 0.0), (-first[1], first[0], 0.0)
    whole = add(add(transform(u, h), cross(axis.w, p)), (-force[1], force[0], 0.0))
    gap, double = xx - yy, xy + xy
    spun = (
        u[2][0] * gap + u[2][1] * double + u[1][0] * yz + differences[0] * xz,
        u[0][1] * xz + u[2][0] * double - u[2][1] * gap - differences[1] * yz,
        differences[2] * gap - double * (u[1][0] + u[0][1]) - u[1][2] * yz - u[0][2] * xz,
    )
    across, along = pxy + pyx, pxx - pyy
    drifting = (
        across * wx - along * wy + pzy * wz,
        -(along * wx) - across * wy - pzx * wz,
        pyz * wx - pxz * wy,
    )
    lifted = add(cross(h, axis.acceleration), (-moment[1], moment[0], 0.0))
    return whole, add(add(spun, drifting), lifted)


def _turning_wrench(axis: Axis, composite: Composite) -> Wrench:
    """2 w x (z x h) + z x p and (tr P - P^T) z - 2 z x S w, P and p the composite's momenta."""
    (_, (hx, hy, _), (xx, yy, _, xy, xz, yz)), ((px, py, pz), first), _ = composite
    x, y, z = add(axis.w, axis.w)
    force = (-(hx * z) - first[1], first[0] - hy * z, hx * x + hy * y)
    sx, sy = xx * x + xy * y + xz * z, xy * x + yy * y + yz * z
    return force, (sy - pz[0], -sx - pz[1], px[0] + py[1])


def _slid_wrench(axis: Axis, composite: Composite) -> Wrench:
    """m z'' and h x z'' + z x F, F the whole force."""
    body, (_, first), (force, _) = composite
    whole = add(scale(axis.acceleration, body.mass), transform(axis.spin.field, body.moment))
    whole = add(add(whole, cross(axis.w, first)), force)
    return scale(axis.bend, body.mass), add(cross(body.moment, axis.bend), (-whole[1], whole[0], 0.0))


def _sliding_wrench(axis: Axis, composite: Composite) -> Wrench:
    """2 m z' and 2 h x z'"""
    body = composite.body
    return scale(axis.twice, body.mass), cross(body.moment, axis.twice)
