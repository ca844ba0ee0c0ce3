"""Derives the dynamics model of a robot, that is, its inverse dynamics as matrices, in all steps."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from psdmc.derivation.base_parameters import PIVOT_TOLERANCE, Reduction, reduction_for
from psdmc.derivation.certify import judged, measured, snap_effect
from psdmc.derivation.closed_loops import require_closable, with_passive_joints
from psdmc.derivation.expand import EXTENDED, FINEST, Precision, can_be_finest, precision_for
from psdmc.derivation.expand import expand as expanded
from psdmc.derivation.memory import UNEXPANDED, refuse_long, refuse_uncountable, types_along_paths
from psdmc.derivation.monomials import merged
from psdmc.derivation.scaled import Scaled, length_unit, parameter_units, scaled
from psdmc.dynamics.regressor import EFFECT
from psdmc.errors import DerivationError, InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import under_general_gravity
from psdmc.progress import Progress, silent
from psdmc.reproducible import times
from psdmc.robot.load import LoadedRobot
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array, Mechanism, require_derivable

EQUATION_NOISE = 3e-14
"""Relative uncertainty of a coefficient of B: rounding, magnified by the back substitution."""

LARGEST_CHAIN = 200
"""Joints; beyond, base parameters alone take more than a minute and 2 GiB."""

SIZES = (1e-12, 1e12)
"""m; a robot's longest step must lie between these: squares of other lengths exceed the range of double precision."""

GOOD = 1e-13
"""Where E and P leave larger errors than this, coefficients that matter were taken for zeros: they are computed again
with FINEST."""

LAST_DIGIT = 4e-16
"""The same limit where B was found in extended precision."""


def derive_model(
    chain: Mechanism,
    *,
    expand: bool | None = None,
    progress: Progress | None = None,
    provenance: Mapping[str, Any] | None = None,
    memory: int | None = None,
    gravity_input: bool = False,
) -> DynamicsModel:
    """Derive the robot's dynamics model: exponents E and coefficients P of the torques, and base parameters theta_b.

    The model is certified, that is, its torques are compared with those of the Newton-Euler algorithm.

    expand      False: leave out E and P, for robots of any size. None: leave them out for trees, for robots with mimic
                joints, and for joints of several coordinates
    progress    function that is called with the name of each step as the step begins
    provenance  plain JSON values to keep with the model; the tolerances used are added
    memory      bytes that the computation of E and P may take; default: most of the machine's free memory
    gravity_input  True: base parameters that determine the torques under every gravity; E and P are left out

    Raises InputError if a joint has no coordinate of its own. Raises DerivationError if E and P would take too much
    memory or time, or if the robot has more joints than LARGEST_CHAIN. Raises DerivationError also if numbers of the
    robot exceed double precision, or if no parameter has any effect.
    """
    tell = progress or silent
    require_derivable(chain)
    _refuse_absurd(chain)
    if gravity_input:
        if expand:
            raise InputError(
                f"'{chain.name}': E and P contain one direction of gravity, and gravity is an input",
                "leave --expand out",
            )
        origin = {**(provenance or {}), "gravity_input": True}
        own = derive_model(under_general_gravity(chain), expand=False, progress=tell, provenance=origin)
        return replace(own, mechanism=replace(own.mechanism, gravity=chain.gravity))
    chain = with_passive_joints(chain, require_closable(chain))
    if expand is None:
        expand = chain.is_serial and not chain.has_mimic_joints and all(kind.about_z for kind in chain.types)
    if expand:
        _refuse_wide(chain)
        refuse_long(0, types_along_paths(chain.types, chain.parents), len(chain))
        refuse_uncountable(chain.types)
    robot = scaled(chain)
    tell("base parameters")
    reduction = reduction_for(robot)
    if not len(reduction.pivots):
        raise DerivationError(
            f"'{chain.name}': no inertial parameter has any effect on any joint",
            "give masses and inertias, or assume fewer of them zero",
        )
    B = base_parameter_map(robot, reduction)
    theta_b = base_parameters(B, chain)

    def made(precision: Precision) -> DynamicsModel:
        used = {"tolerances": tolerances(precision, reduction)}
        # As a model file gives the values back: tuples become lists.
        plain: dict[str, Any] = json.loads(json.dumps(dict(provenance or {}) | used))
        return DynamicsModel(
            expansion=expanded(robot, reduction, precision, tell, memory) if expand else None,
            theta_b=theta_b,
            B=B,
            mechanism=chain,
            certificate=np.zeros(chain.nv),
            provenance=plain,
        )

    precision = precision_for(robot, reduction)
    model = made(precision)
    tell("certificate")
    found = measured(model)
    if expand and precision is EXTENDED and can_be_finest() and not np.all(found.errors <= GOOD):
        found = measured(made(FINEST))
    return replace(found.model, certificate=judged(found))


def _refuse_wide(chain: Mechanism) -> None:
    wide = next((joint for joint in chain.joints if not joint.type.about_z), None)
    if wide is not None:
        raise DerivationError(
            f"'{chain.name}': joint '{wide.name}' {wide.type.verb}: E and P are of joints of one coordinate",
            UNEXPANDED,
        )


def _refuse_absurd(chain: Mechanism) -> None:
    if len(chain) > LARGEST_CHAIN:
        raise DerivationError(
            f"'{chain.name}': {len(chain)} joints, psdmc derives robots of up to {LARGEST_CHAIN}",
            "cut a chain out of it with --base and --tip",
        )
    unit = length_unit(chain)
    if not SIZES[0] < unit < SIZES[1]:
        raise DerivationError(
            f"'{chain.name}': its longest step from joint to joint is about {unit:.1g} m, expected "
            f"{SIZES[0]:g} to {SIZES[1]:g}",
            "check the units of lengths: they are metres",
        )


def tolerances(precision: Precision, reduction: Reduction) -> dict[str, float]:
    """Return the tolerances that this derivation used, by name, for the model's provenance."""
    return {
        "coefficient": precision.zero,
        "value_noise": precision.noise,
        "pivot": PIVOT_TOLERANCE if reduction.is_clear else EFFECT,
        "equation_noise": _equation_noise(reduction),
    }


def _equation_noise(reduction: Reduction) -> float:
    return EQUATION_NOISE if reduction.is_clear else LAST_DIGIT


def base_parameter_map(robot: Scaled, reduction: Reduction) -> Array:
    """Return the matrix B (l, 11 n) in SI units, which computes l base parameters from the standard parameters of n
    links.

    Base parameters are the combinations of standard parameters that torques depend on. A column of B is zero if the
    model's assumptions make its standard parameter zero or a combination of others.
    """
    units = parameter_units(robot.types, robot.unit)[robot.leads]
    echelon = reduction.echelon * units[reduction.pivots][:, None] / units
    B = np.zeros((len(reduction.pivots), PARAMETERS_PER_LINK * len(robot.types)))
    noise = _equation_noise(reduction) * np.abs(echelon.reshape(-1))
    B[:, robot.leads] = merged(echelon.reshape(-1), noise).reshape(echelon.shape)
    return B


def base_parameters(B: Array, chain: Mechanism) -> Array | None:
    """Compute the base parameters theta_b = B x (l,) from the standard parameters x (11 n,) of the n links of `chain`.

    The result is None if theta_b depends on a parameter that is unknown.
    """
    x = chain.parameters.reshape(-1)
    unknown = np.isnan(x)
    if B[:, unknown].any():
        return None
    theta: Array = times(B, np.where(unknown, 0.0, x))
    return theta


def provenance_of(loaded: LoadedRobot) -> dict[str, Any]:
    """Return the model's origin as plain JSON values, with which psdmc can read the robot file again."""
    effect = snap_effect(loaded.mechanism, loaded.unsnapped().chain) if loaded.snap_report else None
    return {
        "source_text": loaded.source_text,
        "source_sha256": hashlib.sha256(loaded.source_text.encode()).hexdigest(),
        "source_format": loaded.source_format,
        "source_name": loaded.source_name,
        "options": loaded.options.as_json(),
        "snapped": [{"where": snap.where, "angle_rad": snap.angle} for snap in loaded.snap_report],
        "snap_torque_change": None if effect is None else effect.tolist(),
    }
