"""Rules by which JAX and PyTorch differentiate a generated function: each rule calls other generated functions.

In this module, a derivative by q has one entry for each of the nv joint rates. It is the derivative as q moves at that
rate ("along the tangent"). `Coordinates` (coordinates.py) converts it to the derivative by the nq entries of q. If q
contains quaternions, the derivative is that of f(q with normalized quaternions).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

from psdmc.errors import InputError
from psdmc.functions import SIGNATURES
from psdmc.program.kernel import GRAVITY
from psdmc.program.signature import TAU, Signature

Array = Any
"""An array of the framework's, with leading axes (...) for states."""

Arrays = tuple[Array, ...]


class ArgumentError(InputError, ValueError):
    """A JAX or PyTorch function of a robot has a wrong argument, or its derivative by this argument does not exist."""


class Framework(Protocol):
    """The array library of JAX or PyTorch, and a method that calls generated functions, for rules."""

    @property
    def arrays(self) -> Any:
        """The array library: jax.numpy, torch or numpy."""

    def call(self, function: str, *inputs: Array) -> Arrays:
        """Return the outputs of a generated function. If the user gave a theta_b and the function depends on theta_b,
        the user's values are used. The same holds for gravity. Leading axes broadcast, those of theta_b too."""

    def under(self, gravity: Array) -> Framework:
        """Return the same with gravity (..., 3), which `call` gives to functions with the input gravity."""


@dataclass(frozen=True, slots=True)
class Rule:
    """How JAX and PyTorch differentiate one generated function.

    along       forward mode: function of (framework, inputs, tangents, dtheta) that returns the derivatives of all
                outputs along the tangents. `tangents` are directions in which the inputs change; that of a
                configuration q has nv entries. dtheta: (..., l), direction of theta_b, or None if theta_b does not
                change
    back        reverse mode: function of (framework, inputs, cotangents, by_theta) that returns the gradients of
                sum(cotangents * outputs) by each input. If `by_theta`, it also returns the gradient by theta_b (...,
                l), else None. Gradients have the leading axes of the states
    parameters  whether there are derivatives by theta_b
    constant    names of the inputs without derivatives: their tangents are ignored, and their gradients are None
    """

    along: Callable[[Framework, Arrays, Arrays, Array | None], Arrays]
    back: Callable[[Framework, Arrays, Arrays, bool], tuple[Arrays, Array | None]]
    parameters: bool = False
    constant: tuple[str, ...] = ()


def rule_of(function: str) -> Rule | None:
    """Return the rule by which JAX and PyTorch differentiate a generated function; None if there is none."""
    if f"{function}_vjp" in SIGNATURES and f"{function}_jvp" in SIGNATURES:
        is_held = "active" in (each.name for each in SIGNATURES[function].inputs)
        return _contacts(function) if is_held else _gradient(function)
    if "A" in (output.name for output in _outputs(f"{function}_derivatives")):
        return _step(function)
    blocks = {f"d{out.name}_d{by.name}" for out in _outputs(function) for by in SIGNATURES[function].inputs}
    if blocks and blocks == {output.name for output in _outputs(f"{function}_derivatives")}:
        return _OTHERS.get(function) or _blocks(function)
    return _OTHERS.get(function)


def require_rule(
    function: str, gravity: bool = False, moves: bool = True, asked: str | None = None, order: int = 1
) -> Rule:
    """Return the rule that differentiates a generated function. Raises ArgumentError if psdmc has none.

    gravity  whether the function's last input is gravity
    moves    whether derivatives by gravity are wanted
    asked    name of the function that the user called, if other rules call this one; the error names it
    order    number of times that the user's function is differentiated
    """
    rule = rule_of(function)
    if rule is None:
        raise no_derivatives(asked or function, order)
    return _with_gravity(function, rule, moves) if gravity else rule


SECOND = {
    "gravity": "inverse_dynamics_second_derivatives with zero rates and accelerations",
    "nonlinear_effects": "inverse_dynamics_second_derivatives with zero accelerations",
}
"""Functions whose second derivatives are those of another one."""


def no_derivatives(function: str, order: int) -> ArgumentError:
    """Return the error that says: the function that the user called has no derivatives of this order."""
    stem = re.sub("_(vjp_parameters|vjp|jvp|derivatives)$", "", function)
    own = f"{stem}_second_derivatives"
    if order == 1 and stem == function:
        known = ", ".join(name for name in SIGNATURES if rule_of(name))
        return ArgumentError(
            f"{function} has no derivatives", f"these functions have first derivatives: {known}"
        )
    which = {1: "", 2: "second ", 3: "third "}.get(order, "such high ")
    other = own if own in SIGNATURES else SECOND.get(stem)
    remedy = "take differences of first derivatives"
    if other and order + (stem != function) == 2:
        remedy = f"call robot.{other}: it returns those of a weighted sum of the results"
    return ArgumentError(f"{function} has no {which}derivatives", remedy)


def refuse_constant(function: str, given: str) -> ArgumentError:
    """Return the error that says: `function` has no derivative by the input named `given`, or by theta_b."""
    if given == "theta_b":
        known = ", ".join(name for name in SIGNATURES if (rule := rule_of(name)) and rule.parameters)
        return ArgumentError(f"{function} has no derivative by theta_b", f"these functions have one: {known}")
    is_of_steps = given in ("dt", GRAVITY.name)
    other = ", or write the step with forward_dynamics and integrate" if is_of_steps else ""
    return ArgumentError(f"{function} has no derivative by {given}", f"keep {given} constant{other}")


def _with_gravity(name: str, rule: Rule, moves: bool) -> Rule:
    """Return the rule of a function with gravity as its last input. Torques are linear in gravity: a change of gravity
    acts on results as its torques at rest do, and at given motor torques as their opposite. Steps with several stages
    have no such torques."""
    names = [each.name for each in SIGNATURES[name].inputs]
    at = names.index(TAU.name) if TAU.name in names else None
    is_scalar = name == "potential_energy"
    weight = name if is_scalar else "gravity"
    is_fixed = not moves or name.endswith("rk4_step")

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        *own, gravity = inputs
        *ways, way = tangents
        under = f.under(gravity)
        if is_fixed:
            return rule.along(under, tuple(own), tuple(ways), dtheta)
        (pulled,) = f.under(way).call(weight, own[0])
        if at is None:
            (found,) = rule.along(under, tuple(own), tuple(ways), dtheta)
            return (found + pulled,)
        ways[at] = ways[at] - pulled
        return rule.along(under, tuple(own), tuple(ways), dtheta)

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        *own, gravity = inputs
        found, theta = rule.back(f.under(gravity), tuple(own), cotangents, by_theta)
        if is_fixed:
            return (*found, None), theta
        weights = -found[at] if at is not None else cotangents[0][..., None] if is_scalar else cotangents[0]
        units = f.arrays.eye(3, dtype=weights.dtype).reshape(3, *(1,) * (weights.ndim - 1), 3)
        (pulled,) = f.under(units).call(weight, own[0])
        pulled = pulled[..., None] if is_scalar else pulled
        return (*found, f.arrays.moveaxis((pulled * weights).sum(-1), 0, -1)), theta

    constant = (*rule.constant, *((GRAVITY.name,) if is_fixed else ()))
    return replace(rule, along=along, back=back, constant=constant)


def _outputs(function: str) -> tuple[Any, ...]:
    known: Signature | None = SIGNATURES.get(function)
    return () if known is None else known.outputs


def _weighted(f: Framework, weights: Array, matrix: Array) -> Array:
    """weights^T matrix, state by state."""
    return f.arrays.einsum("...i,...ij->...j", weights, matrix)


def _times(f: Framework, matrix: Array, vector: Array) -> Array:
    """matrix vector, state by state."""
    return f.arrays.einsum("...ij,...j->...i", matrix, vector)


def _gradient(name: str) -> Rule:
    """Return the rule of inverse or forward dynamics, with wrenches or without, which have functions for both modes.
    Torques are linear in theta_b: the regressor gives their change, and at fixed torques accelerations change as by the
    opposite torques."""
    is_inverse = name.startswith("inverse_dynamics")

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        if is_inverse:
            (found,) = f.call(f"{name}_jvp", *inputs, *tangents)[1:]
            if dtheta is not None:
                found = found + _times(f, f.call("regressor", *inputs[:3])[0], dtheta)
            return (found,)
        if dtheta is not None:
            (qdd,) = f.call(name, *inputs)
            (regressor,) = f.call("regressor", *inputs[:2], qdd)
            dq, dqd, dtau, *others = tangents
            tangents = (dq, dqd, dtau - _times(f, regressor, dtheta), *others)
        return f.call(f"{name}_jvp", *inputs, *tangents)[1:]

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        has_own = f"{name}_vjp_parameters" in SIGNATURES
        called = f"{name}_vjp_parameters" if by_theta and has_own else f"{name}_vjp"
        value, *found = f.call(called, *inputs, *cotangents)
        gradients, last = tuple(found[: len(inputs)]), found[len(inputs) :]
        if not by_theta or has_own:
            return gradients, last[0] if by_theta else None
        weights, qdd = (cotangents[0], inputs[2]) if is_inverse else (-gradients[2], value)
        return gradients, _weighted(f, weights, f.call("regressor", *inputs[:2], qdd)[0])

    return Rule(along, back, parameters=True)


def _contacts(name: str) -> Rule:
    """Return the rule of a function with contacts. Its derivatives take the function's inputs by name, in another order.
    At fixed torques, a change of theta_b acts as the opposite change of the torques, and in an impact as an impulse of
    the joints."""
    signature, backward, forward = (SIGNATURES[f"{name}{ending}"] for ending in ("", "_vjp", "_jvp"))
    names = [each.name for each in signature.inputs]
    gradients = [each.name for each in backward.outputs]

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        given = dict(zip(names, inputs, strict=True))
        given |= {f"d{each}": tangent for each, tangent in zip(names, tangents, strict=True)}
        if dtheta is not None and "dtau" in given:
            qdd, _ = f.call(name, *inputs)
            (regressor,) = f.call("regressor", *inputs[:2], qdd)
            given["dtau"] = given["dtau"] - _times(f, regressor, dtheta)
        found = f.call(forward.name, *(given[each.name] for each in forward.inputs))[2:]
        if dtheta is None or "dtau" in given:
            return found
        return tuple(x + y for x, y in zip(found, _impulse_by_theta(f, given, dtheta), strict=True))

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        given = dict(zip(names, inputs, strict=True))
        weights = zip(signature.outputs, cotangents, strict=True)
        given |= {f"cotangent_{output.name}": weight for output, weight in weights}
        called = f"{backward.name}_parameters" if by_theta else backward.name
        found = f.call(called, *(given[each.name] for each in backward.inputs))
        values = dict(zip(gradients, found, strict=False))
        return tuple(values.get(f"grad_{each}") for each in names), found[-1] if by_theta else None

    constant = tuple(each for each in names if f"grad_{each}" not in gradients)
    return Rule(along, back, f"{backward.name}_parameters" in SIGNATURES, constant)


def _impulse_by_theta(f: Framework, given: dict[str, Array], dtheta: Array) -> Arrays:
    """The change of an impact's rates and impulses with theta_b. Its equations have the matrix of constrained forward
    dynamics, and M (after - before) changes as torques at rest and without gravity do: see that function's `dtau`."""
    q, before = given["q"], given["qd_before"]
    after, _ = f.call("impulse", *(given[each.name] for each in SIGNATURES["impulse"].inputs))
    still = 0.0 * before
    kick, weight = (f.call("regressor", q, still, change)[0] for change in (after - before, still))
    response = SIGNATURES["constrained_forward_dynamics_jvp"]
    zero, of_rows = 0.0 * given["mu"], 0.0 * f.call("contact_drift", q, still)[0]
    known = {each.name: still for each in response.inputs if each.axes == ("nv",)}
    known |= {"q": q, "active": given["active"], "mu": given["mu"], "kp": zero, "kd": zero}
    known |= {"error": of_rows, "derror": of_rows, "dtau": -_times(f, kick - weight, dtheta)}
    return f.call(response.name, *(known[each.name] for each in response.inputs))[2:]


def _blocks(name: str) -> Rule:
    """Return the rule of a function of vectors along nv, if another function computes all of its derivatives."""
    ((*axes,),) = (output.axes for output in _outputs(name))
    rows = "abc"[: len(axes)]

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        pairs = zip(f.call(f"{name}_derivatives", *inputs), tangents, strict=True)
        first, *others = (f.arrays.einsum(f"...{rows}j,...j->...{rows}", *pair) for pair in pairs)
        return (sum(others, start=first),)

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        found = f.call(f"{name}_derivatives", *inputs)
        (weights,) = cotangents
        return tuple(f.arrays.einsum(f"...{rows},...{rows}j->...j", weights, block) for block in found), None

    return Rule(along, back)


def _step(name: str) -> Rule:
    """Return the rule of a time step, from the matrices A by (q, qd) and B by tau; with contacts, from B_error and force
    derivatives."""
    jacobians, names = f"{name}_derivatives", [each.name for each in SIGNATURES[name].inputs]
    _, _, *others = (output.name for output in _outputs(name))
    known = [output.name for output in _outputs(jacobians)]

    def blocks(f: Framework, inputs: Arrays) -> dict[str, Arrays]:
        """Return by each input the derivatives of the state and those of the other outputs."""
        found, nv = dict(zip(known, f.call(jacobians, *inputs), strict=True)), inputs[1].shape[-1]
        own = {"q": found["A"][..., :nv], "qd": found["A"][..., nv:], "tau": found["B"]}
        own |= {each.removeprefix("B_"): found[each] for each in known if each.startswith("B_")}
        return {by: (block, *(found[f"d{each}_d{by}"] for each in others)) for by, block in own.items()}

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        given = dict(zip(names, tangents, strict=True))
        by_input = blocks(f, inputs).items()
        moved = [[_times(f, block, given[by]) for block in own] for by, own in by_input]
        state, *rest = (sum(others, start=first) for first, *others in zip(*moved, strict=True))
        nv = inputs[1].shape[-1]
        return state[..., :nv], state[..., nv:], *rest

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        weights = (f.arrays.concatenate(cotangents[:2], -1), *cotangents[2:])
        found = {}
        for by, own in blocks(f, inputs).items():
            first, *rest = (_weighted(f, *pair) for pair in zip(weights, own, strict=True))
            found[by] = sum(rest, start=first)
        return tuple(found.get(each) for each in names), None

    moving = {"q", "qd", "tau", *(each.removeprefix("B_") for each in known if each.startswith("B_"))}
    return Rule(along, back, constant=tuple(each for each in names if each not in moving))


INVERSE, FORWARD = _gradient("inverse_dynamics"), _gradient("forward_dynamics")


def _still(f: Framework, inputs: Arrays, like: Array) -> Arrays:
    """q, qd and qdd of torques without acceleration: qd is zero where it is not given. `like` has nv entries."""
    q, *qd = inputs
    zero = f.arrays.zeros_like(like)
    return (q, *(qd or [zero]), zero)


def _bias() -> Rule:
    """Return the rule of gravity(q) or nonlinear_effects(q, qd): inverse dynamics at zero rates, or without
    accelerations."""

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        like = tangents[0]
        return INVERSE.along(f, _still(f, inputs, like), _still(f, tangents, like), dtheta)

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        found, theta = INVERSE.back(f, _still(f, inputs, cotangents[0]), cotangents, by_theta)
        return found[: len(inputs)], theta

    return Rule(along, back, parameters=True)


def _columns(base: Rule) -> Rule:
    """Return the rule of M(q) or its inverse, which is symmetric. Column j is inverse or forward dynamics at rest with unit
    acceleration or torque j, less those with none. The columns are a leading axis of the calls."""

    def unit(f: Framework, q: Array, like: Array) -> tuple[Arrays, Arrays]:
        nv, zero = like.shape[-1], f.arrays.zeros_like(like)
        each = f.arrays.eye(nv, dtype=like.dtype).reshape(nv, *(1,) * (like.ndim - 1), nv)
        units = f.arrays.broadcast_to(each, (nv, *like.shape))
        return (q, zero, units), (q, zero, zero)

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        (dq,) = tangents
        zero = f.arrays.zeros_like(dq)
        parts = (base.along(f, states, (dq, zero, zero), dtheta)[0] for states in unit(f, inputs[0], dq))
        columns, none = parts
        return (f.arrays.moveaxis(columns - none, 0, -1),)

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        weights = f.arrays.moveaxis(cotangents[0], -1, 0)
        whole = weights.sum(0)
        units, none = unit(f, inputs[0], whole)
        (more, *_), theta = base.back(f, units, (weights,), by_theta)
        (less, *_), other = base.back(f, none, (whole,), by_theta)
        by_q = more.sum(0) - less
        return (by_q,), None if theta is None or other is None else theta.sum(0) - other

    return Rule(along, back, parameters=True)


def _kinetic() -> Rule:
    """Return the rule of T = qd . M qd / 2, where M qd are the torques at rest with the accelerations qd, less those
    without."""

    def slopes(f: Framework, inputs: Arrays, by_theta: bool) -> tuple[Array, Array, Array | None]:
        q, qd = inputs
        zero = f.arrays.zeros_like(qd)
        called = "inverse_dynamics_vjp_parameters" if by_theta else "inverse_dynamics_vjp"
        more, less = f.call(called, q, zero, qd, qd), f.call(called, q, zero, zero, qd)
        by_theta_b = 0.5 * (more[-1] - less[-1]) if by_theta else None
        return 0.5 * (more[1] - less[1]), more[0] - less[0], by_theta_b

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        by_q, by_qd, theta = slopes(f, inputs, dtheta is not None)
        found = (by_q * tangents[0]).sum(-1) + (by_qd * tangents[1]).sum(-1)
        return (found if theta is None else found + (theta * dtheta).sum(-1),)

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        by_q, by_qd, theta = slopes(f, inputs, by_theta)
        weight = cotangents[0][..., None]
        return (weight * by_q, weight * by_qd), None if theta is None else weight * theta

    return Rule(along, back, parameters=True)


def _jacobian(function: str, is_scalar: bool = False) -> Rule:
    """Return the rule of a function of q whose Jacobian, or gradient, another function is."""

    def jacobian(f: Framework, inputs: Arrays) -> Array:
        (found,) = f.call(function, *inputs)
        return found[..., None, :] if is_scalar else found

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        found = _times(f, jacobian(f, inputs), tangents[0])
        return (found[..., 0] if is_scalar else found,)

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        weights = cotangents[0][..., None] if is_scalar else cotangents[0]
        return (_weighted(f, weights, jacobian(f, inputs)),), None

    return Rule(along, back)


def _poses() -> Rule:
    """Return the rule of forward kinematics, by the frames' Jacobian: an axis of a frame that turns at w moves at w x
    axis."""

    def along(f: Framework, inputs: Arrays, tangents: Arrays, dtheta: Array | None) -> Arrays:
        (jacobian,) = f.call("frame_jacobian", *inputs)
        _, rotation = f.call("forward_kinematics", *inputs)
        moved = f.arrays.einsum("...fij,...j->...fi", jacobian, tangents[0])
        axes = f.arrays.swapaxes(rotation, -1, -2)
        turned = f.arrays.linalg.cross(f.arrays.broadcast_to(moved[..., None, 3:], axes.shape), axes)
        return moved[..., :3], f.arrays.swapaxes(turned, -1, -2)

    def back(f: Framework, inputs: Arrays, cotangents: Arrays, by_theta: bool) -> tuple[Arrays, Array | None]:
        (jacobian,) = f.call("frame_jacobian", *inputs)
        _, rotation = f.call("forward_kinematics", *inputs)
        axes, weights = (f.arrays.swapaxes(each, -1, -2) for each in (rotation, cotangents[1]))
        moments = f.arrays.linalg.cross(axes, weights).sum(-2)
        wrenches = f.arrays.concatenate((cotangents[0], moments), -1)
        return (f.arrays.einsum("...fi,...fij->...j", wrenches, jacobian),), None

    return Rule(along, back)


_OTHERS = {
    "gravity": _bias(),
    "nonlinear_effects": _bias(),
    "mass_matrix": _columns(INVERSE),
    "mass_matrix_inverse": _columns(FORWARD),
    "kinetic_energy": _kinetic(),
    "potential_energy": _jacobian("gravity", is_scalar=True),
    "centre_of_mass": _jacobian("com_jacobian"),
    "forward_kinematics": _poses(),
}
