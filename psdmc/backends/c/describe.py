"""A description of the robot and its C functions, for the first lines of the C header."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap

from psdmc.backends.c.kernel_view import FunctionView
from psdmc.backends.describe import contact_lines, facts, frame_lines, uses_contacts
from psdmc.backends.info import EmitOptions, PackageInfo
from psdmc.program.signature import Signature
from psdmc.program.theta_rows import THETA_ROWS
from psdmc.target.target import Target

WIDTH = 116
"""Characters of a line in the header."""


def description(
    info: PackageInfo, options: EmitOptions, functions: Sequence[FunctionView], with_frames: bool
) -> tuple[str, ...]:
    """Return the text at the top of the C header, as lines. It gives the facts of the robot, the layout of arrays, and
    the variants of functions (such as for many states). Names from the robot file are not escaped yet."""
    lines = [*facts(info, options), *_friction(info, functions), *_arrays(info), *_forms(options.target)]
    if any(function.name.endswith(THETA_ROWS) for function in functions):
        lines += [
            f"  _theta_rows with one theta_b per state: thetas is an input like q, a state has l = {info.l} reals of it"
        ]
    if any(len(function.signature.outputs) > 1 for function in functions):
        lines += ["Several outputs of one call must not overlap each other."]
    lines += [line for function in functions for line in _failure(function.signature, options.target)]
    touching = uses_contacts(function.signature for function in functions)
    return (
        *lines,
        *(frame_lines(info) if with_frames else ()),
        *(contact_lines(info) if touching else ()),
    )


def _friction(info: PackageInfo, functions: Sequence[FunctionView]) -> tuple[str, ...]:
    """The friction that motor torques contain, with its values, and which functions contain it."""
    law = info.in_dynamics
    if law is None:
        return ()
    names: dict[bool, list[str]] = {True: [], False: []}
    for function in functions:
        names[function.signature.has_motor_torques].append(function.name)
    headings = [name for term in law.terms for name in term.names]
    return (
        "Friction in the dynamics: tau are the torques of the motors, M(q) qdd + h(q, qd) + friction (N m; N if sliding).",
        "Friction is positive where the motor must push in the positive direction. Friction that brakes has the",
        f"sign of the joint's rate v (rad/s; m/s if sliding). With s = tanh(v / {law.sign_speed!r}), a smooth sign, it is",
        f"  {law.formula}",
        f"Values per joint ({', '.join(headings)}):",
        *(
            f"  {joint}: {', '.join(f'{x:.9g}' for x in values)}"
            for joint, values in zip(_with_friction(info), law.values.tolist(), strict=True)
        ),
        *wrap(f"Functions with friction: {', '.join(names[True]) or 'none'}.", WIDTH, subsequent_indent="  "),
        *wrap(
            f"Functions without friction: {', '.join(names[False]) or 'none'}.", WIDTH, subsequent_indent="  "
        ),
        *(
            (f"The calibration also found what tau does not have: {'; '.join(law.beyond)}.",)
            if law.beyond
            else ()
        ),
        "",
    )


def _with_friction(info: PackageInfo) -> list[str]:
    """Names of the joints that have friction: those of one rate."""
    return [joint.name for joint in info.joints if joint.nv == 1]


def _arrays(info: PackageInfo) -> tuple[str, ...]:
    """Lengths of vectors."""
    if not info.is_wide:
        return (
            "Arrays: n reals per vector; matrices row-major. Inputs may overlap each other. An output may overlap any",
        )
    return (
        f"Arrays: q has NQ = {info.nq} reals, rates and torques have NV = {info.nv} each; matrices row-major. Quaternions,",
        "and cosine and sine of an angle, are of length one: only integrate sees to it, in others one that is off by more",
        "than 1e-6 gives results that are off, too. Where something is added to q it is integrate that adds. Inputs may",
        "overlap each other. An output may overlap any",
    )


def _forms(target: Target) -> tuple[str, ...]:
    """Return lines that say what a call may overlap, and what the variants' names mean."""
    if not target.has_batches:
        return ("input.", "  _theta      with the base parameters theta_b given at run time")
    return (
        "input of a call for one state. In a batch it may be the very array of an input whose rows are equally long,",
        "and must not overlap an input (theta_b is one) in any other way.",
        "  _batch      one state per row",
        "  _batch_soa  blocks of LANES states, [block][variable][lane]; the last block is whole, too",
        "  _theta      with the base parameters theta_b given at run time (_theta_batch: one theta_b for all rows)",
    )


def _failure(function: Signature, target: Target) -> tuple[str, ...]:
    if not function.factorises:
        return ()
    status = f"{function.name} returns 0, or 1 + {', or 1 + '.join(function.pivot_numbers)}."
    if not target.has_batches:
        return (status, f"The {function.spoilt} of such a state are NaN.")
    return (
        status,
        f"A batch returns 0, or 1 + the first row that fails. The {function.spoilt} of such a state are NaN.",
    )
