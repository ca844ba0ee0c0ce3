"""The whole compiler: the functions `derive`, `emit_c` and `compile`. Start to read the source code of psdmc here.

The table lists the steps in the order in which they run. E, P and theta_b are the model's exponents, coefficients and
base parameters. A kernel is one generated function. A PROGRAM is the list of operations to generate. A lane is
one slot of a SIMD vector, for one of several states.

step         in                                         out
robot        robot file, options                        LoadedRobot: a Mechanism and the file that it comes from
derivation   Mechanism                                  DynamicsModel: E, P, theta_b, certificate (the MODEL)
lower        DynamicsModel, names of functions, costs   Kernels: PROGRAMs of each function for one state and SIMD lanes
backends     Emission: Kernels, facts, reference states the text of each file of a package, in C or another language
toolchain    PackageView                                shared library with its Interface, then CompiledRobot
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from psdmc.backends.c.adapters import chosen
from psdmc.backends.manifest import MANIFEST
from psdmc.backends.package_folder import (
    Changes,
    Differences,
    differences,
    recorded_options,
    require_own_folder,
    write_package,
)
from psdmc.backends.protocol import back_end
from psdmc.emission import (
    CompileRequest,
    EmitRequest,
    cuda_robot,
    emission,
    emit_options,
    functions_of,
    listed,
)
from psdmc.errors import InputError
from psdmc.functions import BY_ROWS
from psdmc.garbage import collecting_rarely
from psdmc.lower.admitted import wanted
from psdmc.lower.kernels import Lowering
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import model_of
from psdmc.progress import Progress, silent
from psdmc.robot.load_options import DEFAULT_SNAP
from psdmc.target.presets import NATIVE
from psdmc.target.target import Real, Target, Trig
from psdmc.toolchain.call import CompiledRobot

if TYPE_CHECKING:
    import numpy as np

    from psdmc.toolchain.cuda_robot import CudaRobot


def derive(
    robot: str | Path,
    base: str | None = None,
    tip: str | None = None,
    gravity: Sequence[float] | None = None,
    drive_inertia: bool | Sequence[float] = False,
    assume_zero: Sequence[str] | str = (),
    snap: float = DEFAULT_SNAP,
    expand: bool | None = None,
    progress: Progress = silent,
    frames: Sequence[str] | str = (),
    tool: Sequence[float] | None = None,
    lock: Mapping[str, float] | None = None,
    floating: bool = False,
    root: str | None = None,
    xacro_args: Mapping[str, object] | None = None,
    packages: Mapping[str, str | Path] | None = None,
    unknown: Sequence[str] | str = (),
    contacts: Sequence[str] | str = (),
    loops: str | Path | Sequence[Mapping[str, Any]] = (),
    gravity_input: bool = False,
) -> DynamicsModel:
    """Derive the dynamics model of a robot from a file (URDF, xacro, MJCF or DH table).

    The result is a DynamicsModel. It contains the base parameters theta_b, the combinations of masses and inertias that
    determine all torques. It also contains the torques as sums of monomials: exponents E and coefficients P (see `expand`).
    Before `derive` returns the model, it compares the model's torques with those of the Newton-Euler algorithm.

    robot          path of the robot file
    base, tip      names of the first and last link, to model only the chain between them; None: the whole robot
    gravity        (3,) m/s^2 along the axes of the file's root frame; None: the gravity in the file, or (0, 0, -9.81)
    drive_inertia  True: the drive inertias of the joints are parameters of the model. Instead of True, you can give the
                   values of the drive inertias, one per joint, kg m^2 (kg for a sliding joint)
    assume_zero    link parameters that psdmc assumes to be zero: a list or one name, such as "link5:mx" (first moment) or
                   "link5:Ixz@com" (inertia about the centre of mass)
    snap           tolerance for right angles, rad. If an angle of the file, such as 1.5708, differs from a right angle by at
                   most `snap`, psdmc uses the exact right angle; 0: never
    expand         False: leave out E and P, which need much memory for robots with many joints; None: leave them out for
                   branched robots only
    progress       function, such as print, that psdmc calls with the name of each stage
    frames         names of the links whose frames you need, for poses, Jacobians, wrenches and loads. These frames become
                   the named frames. If `frames` is empty, they are the tip, or the end of each branch
    tool           x, y, z (m) and roll, pitch, yaw (rad) of a frame, relative to the tip; psdmc adds this frame as 'tool'
    lock           joints that stay at a fixed position: a dictionary of positions (rad or m) by joint name
    floating       True: the root link moves freely. The first entries of q are the link's position (m) and quaternion
                   (x, y, z, w). The first entries of qd are the link's linear and angular velocity along the link's axes
    root           name of the robot's first body, for an MJCF in which several separate bodies move; psdmc leaves out the
                   bodies that do not belong to the robot
    xacro_args     values of the arguments of a xacro file, by name
    packages       folders of ROS packages that a xacro file uses, by package name; psdmc also looks for packages in
                   ROS_PACKAGE_PATH and AMENT_PREFIX_PATH
    unknown        links whose masses and inertias are unknown: a list, one name, "all", or "missing", which means all links
                   without an inertia in the file. Without this option, links without an inertia are massless
    contacts       names of links that can touch the world, for functions such as constrained_forward_dynamics. "foot" is a
                   contact point, "foot:6" a contact surface. These links become named frames, too. If `contacts` is empty,
                   each named frame is a contact point
    loops          path of a TOML file with closed loops, or its tables [[loop]] as a list of dictionaries
    gravity_input  True: derive base parameters that determine the torques under every gravity, so that code for the model
                   can have gravity as an input. There are often more of them. The model has no E and P

    Raises InputError if the file or an option is wrong. Raises DerivationError if the file has no mistake but the model
    needs other options, for example `expand=False` because E and P need too much memory.

    Source: Lloyd, Irani and Ahmadi, Mech. Mach. Theory 156 (2021) 104149.

    >>> derive("examples/robots/scara.toml").joint_names  # doctest: +SKIP
    ('J1', 'J2', 'J3', 'J4')
    """
    # Imported here: Pinocchio and SciPy load slowly, and emission needs neither.
    from psdmc.derivation.derive import derive_model, provenance_of
    from psdmc.robot.load import load_robot

    if not isinstance(robot, str | Path):
        raise InputError(
            f"a {type(robot).__name__} was given where a robot file's path is expected",
            "give the path of a URDF or a DH .toml file",
        )
    progress("reading the robot")
    loaded = load_robot(
        robot,
        base=base,
        tip=tip,
        gravity=gravity,
        drive_inertia=drive_inertia,
        assume_zero=listed(assume_zero),
        snap=snap,
        frames=listed(frames),
        tool=tool,
        lock=lock,
        floating=floating,
        root=root,
        xacro_args=xacro_args,
        packages=packages,
        unknown=listed(unknown),
        contacts=listed(contacts),
        loops=loops,
    )
    return derive_model(
        loaded.mechanism,
        expand=expand,
        progress=progress,
        provenance=provenance_of(loaded),
        gravity_input=gravity_input,
    )


def emit_c(
    model: DynamicsModel | str | Path,
    directory: str | Path,
    lowering: Lowering = "auto",
    functions: Sequence[str] | str | None = None,
    real: Real | None = None,
    trig: Trig | None = None,
    name: str | None = None,
    force: bool = False,
    progress: Progress = silent,
    payload: bool = False,
    adapters: Sequence[str] | str = (),
    target: str | Target = NATIVE,
    friction: bool | Literal["in-dynamics"] = False,
    bodies: bool = False,
    estimator: str | None = None,
    smoothing_speed: float | None = None,
    gravity_input: bool = False,
) -> Changes:
    """Write the C package of a model into a folder. Returns the names of the files that psdmc wrote or removed.

    model      a model, or the path of a model file
    directory  folder for the package; it must be missing, empty, or already hold a package that psdmc wrote
    lowering   how the code computes torques. "expanded": by sums of products of sines, cosines and rates. "factored": by a
               recursion from link to link. "auto": by the method with fewer operations
    functions  names of the functions to generate, or one name; None: the default functions
    real       precision, "float64" or "float32"; None: the precision of the target
    trig       how the code computes sines. "inline": by its own code, with libm only for angles over 1e5 rad;
               "freestanding": without libm; "libm": always with libm; None: the method of the target
    name       name of the robot in C, with which all symbols begin; None: the name of the model
    force      True: write even if the folder contains other files, or package files that you edited. psdmc overwrites
               edited package files. A file of yours with the name of a package file becomes NAME.orig. All others stay
    progress   function, such as print, that psdmc calls with the name of each stage
    payload    True: add the functions that change the base parameters theta_b to those of the robot with a load
    adapters   programs for which psdmc adds files to the package: "casadi", "wheel" (Python), "fmu", "fmu2" (FMI 2.0), "mex"
               (MATLAB) or "ros2"
    target     processor for which psdmc generates code, such as "native", "x86-64-v3", "neon" or "cortex-m4f"
    friction   for a model that was calibrated from logs. True: add the function that computes friction torques.
               "in-dynamics": inverse dynamics, forward dynamics, their derivatives and time steps, also with contacts,
               contain friction
    bodies     True: add the function that computes theta_b from the masses and inertias of all links
    estimator  "mass" or "inertia": add functions that estimate a load at the tip while the robot moves. "mass" finds
               mass and centre of mass, "inertia" also the inertia
    smoothing_speed  for friction="in-dynamics": friction contains a smooth function, tanh(v / smoothing_speed), instead
               of the sign of a joint's speed v. The unit is rad/s, or m/s for sliding joints. None: the value of the
               calibration, usually 0.03
    gravity_input  True: functions whose results depend on gravity get it as an input. This is for a robot whose base tilts.
               Gravity has 3 numbers for each state, m/s^2 along the axes of the base frame, or of the world frame if the
               base is floating. Derive the model with `gravity_input=True`, too: this can add base parameters

    Raises InputError if an option is wrong, or if `friction` is given and the model has no friction. Raises InputError also
    if the model assumes that parameters are zero (`assume_zero` of `derive`) and `payload` or `bodies` would change them.

    Forward dynamics, a default function, and some other functions need the inverse of the mass matrix. If the mass matrix
    is not positive definite at some pose within the joint limits, psdmc raises InputError instead of generating these
    functions. In this case, let `functions` name only functions that do not need the inverse, such as "gravity".
    """
    own: dict[str, Any] = {"payload": payload, "with": adapters, "friction": friction, "bodies": bodies}
    own["smoothing-speed"] = smoothing_speed
    own["estimator"] = estimator
    own["gravity-input"] = gravity_input
    return emit(model, directory, "c", lowering, functions, real, name, force, progress, trig, target, **own)


def emit(
    model: DynamicsModel | str | Path,
    directory: str | Path,
    backend: str,
    lowering: Lowering = "auto",
    functions: Sequence[str] | str | None = None,
    real: Real | None = None,
    name: str | None = None,
    force: bool = False,
    progress: Progress = silent,
    trig: Trig | None = None,
    target: str | Target = NATIVE,
    **own: Any,
) -> Changes:
    """Write the package of a model in the language of a back end (psdmc.backends.protocol), such as C.

    Returns the names of the files that psdmc wrote or removed, as `emit_c` does.

    own  further options that the back end has, by their names on the command line

    Raises InputError for an option that the back end does not have.
    """
    require_own_folder(directory, force)
    files = _files(model_of(model), backend, lowering, functions, real, name, progress, trig, target, **own)
    progress("writing")
    return write_package(directory, files, force)


def compare_emitted(
    model: DynamicsModel | str | Path,
    directory: str | Path,
    given: Mapping[str, Any] | None = None,
    progress: Progress = silent,
) -> Differences:
    """Compare the package in a folder with the package that `emit` would write now with the same options.

    The options are those in the manifest of the folder.

    given  a dictionary from names of command-line options to values. psdmc raises an error if one of these values differs
           from that in the manifest; None: all options are those in the manifest

    This function writes no file. Raises InputError if the folder holds no package, or if `given` contradicts the
    manifest.
    """
    model, recorded = model_of(model), recorded_options(directory)
    for option, value in (given or {}).items():
        if option in ("functions", "with"):
            value = (
                chosen(listed(value))
                if option == "with"
                else functions_of(model, value, recorded["with"], "gravity-input" in recorded)
            )
        had = recorded.get(option)
        if value == had:
            continue
        was = (
            "without it"
            if had in (None, False, ())
            else "with others"
            if isinstance(had, tuple)
            else f"with {had}"
        )
        raise InputError(
            f"{directory}: --{option} contradicts {MANIFEST}: psdmc emitted the package {was}",
            f"type psdmc emit --backend {had} --check"
            if option == "backend"
            else f"leave out --{option}, or emit the package again without --check",
        )
    return differences(directory, _files(model, progress=progress, **recorded))


@collecting_rarely()
def _files(
    model: DynamicsModel,
    backend: str,
    lowering: Lowering,
    functions: Sequence[str] | str | None,
    real: Real | None,
    name: str | None,
    progress: Progress = silent,
    trig: Trig | None = None,
    target: str | Target = NATIVE,
    **own: Any,
) -> dict[str, str]:
    """Path -> text of every file of what `emit` writes."""
    language = back_end(backend)
    options = emit_options(lowering, real, trig, target)
    by_rows = any(name in BY_ROWS for name in listed(functions or ()))
    chosen_options = {"trig": trig, "target": options.target != NATIVE, "functions NAME_theta_rows": by_rows}
    for option in language.lacks:
        if {**chosen_options, **own}.get(option):
            raise InputError(
                f"the back end {backend} has no --{option}", "leave it out, or emit C: psdmc emit-c"
            )
    if by_rows and not options.target.has_batches:
        raise InputError(
            f"target {options.target.name} has no functions for many states, so no NAME_theta_rows",
            "leave --functions out: default functions take theta_b for one state as NAME_theta",
        )
    adapters = listed(own.get("with", ()))
    if adapters and not options.target.hosted:
        raise InputError(
            f"target {options.target.name} has no shared libraries, which {adapters[0]} loads",
            "leave --with out, or emit another package for it",
        )
    asked = EmitRequest(
        lowering,
        functions,
        options,
        name,
        payload=own.get("payload", False),
        adapters=chosen(adapters),
        friction=own.get("friction", False),
        bodies=own.get("bodies", False),
        estimator=own.get("estimator"),
        smoothing_speed=own.get("smoothing-speed"),
        gravity_input=own.get("gravity-input", False),
    )
    return language.files(emission(model, asked, progress))


@overload
def compile(  # type: ignore[overload-overlap]
    model: DynamicsModel | str | Path,
    lowering: Lowering = ...,
    functions: Sequence[str] | str | None = ...,
    real: Real | None = ...,
    *,
    progress: Progress = ...,
    gravity_input: bool = ...,
    target: Literal["cuda", "cuda:0", "cuda:1", "cuda:2", "cuda:3"],
) -> CudaRobot: ...


@overload
def compile(
    model: DynamicsModel | str | Path,
    lowering: Lowering = ...,
    functions: Sequence[str] | str | None = ...,
    real: Literal["float64"] | None = ...,
    trig: Trig | None = ...,
    progress: Progress = ...,
    target: str | Target = ...,
    friction: bool = ...,
    smoothing_speed: float | None = ...,
    gravity_input: bool = ...,
) -> CompiledRobot: ...


@overload
def compile(
    model: DynamicsModel | str | Path,
    lowering: Lowering = ...,
    functions: Sequence[str] | str | None = ...,
    *,
    real: Literal["float32"],
    trig: Trig | None = ...,
    progress: Progress = ...,
    target: str | Target = ...,
    friction: bool = ...,
    smoothing_speed: float | None = ...,
    gravity_input: bool = ...,
) -> CompiledRobot[np.float32]: ...


@overload
def compile(
    model: DynamicsModel | str | Path,
    lowering: Lowering = ...,
    functions: Sequence[str] | str | None = ...,
    real: Real | None = ...,
    trig: Trig | None = ...,
    progress: Progress = ...,
    target: str | Target = ...,
    friction: bool = ...,
    smoothing_speed: float | None = ...,
    gravity_input: bool = ...,
) -> CompiledRobot[np.float32] | CompiledRobot: ...


def compile(
    model: DynamicsModel | str | Path,
    lowering: Lowering = "auto",
    functions: Sequence[str] | str | None = None,
    real: Real | None = None,
    trig: Trig | None = None,
    progress: Progress = silent,
    target: str | Target = NATIVE,
    friction: bool = False,
    smoothing_speed: float | None = None,
    gravity_input: bool = False,
) -> CompiledRobot[Any] | CudaRobot:
    """Compile the functions of a model for this machine. Returns a CompiledRobot, whose methods take NumPy arrays.

    With the target "cuda", psdmc compiles for an NVIDIA GPU, and returns a CudaRobot, whose methods take arrays of CuPy,
    PyTorch or JAX. "cuda:1" is the second GPU. This was run on no GPU yet.

    psdmc keeps the compiled library in a cache, so a second call for the same model and options is fast.

    model      a model, or the path of a model file
    functions  names of functions, or one name, to compile only these functions. None: psdmc compiles the default functions
               now, and each other function when you first call it
    friction   True: inverse dynamics, forward dynamics, their derivatives and time steps, also with contacts, contain the
               friction that a calibration of the model found
    gravity_input  True: methods whose results depend on gravity have the argument `gravity`, (3,) or (..., 3), m/s^2 along
               the axes of the base frame. Without this argument, gravity is that of the model

    `emit_c` explains the other options. Raises InputError if `friction` is True and the model has no calibrated friction.
    Raises InputError also if the target is a microcontroller, because its code lacks the batch functions that Python calls.
    Raises ToolchainError if the compiler or the CPU does not support the target, or if there is no GPU or no NVRTC.

    >>> robot = compile("scara.npz", real="float32")  # doctest: +SKIP
    >>> robot.gravity([0.0, 0.0, 0.0, 0.0]).dtype  # doctest: +SKIP
    dtype('float32')
    """
    found = model_of(model)
    if isinstance(target, str) and target.partition(":")[0] == "cuda":
        absent = {"trig": trig, "friction": friction, "smoothing_speed": smoothing_speed}
        asked = EmitRequest(lowering, functions, emit_options(lowering, real), gravity_input=gravity_input)
        return cuda_robot(found, asked, progress, target, absent)
    names = (functions,) if isinstance(functions, str) else functions
    kept = None if names is None else tuple(names)
    chosen_names = wanted(kept, found.mechanism)
    law: Literal[False, "in-dynamics"] = "in-dynamics" if friction else False
    request = CompileRequest(
        found,
        found.content_hash,
        chosen_names,
        lowering,
        kept,
        real,
        trig,
        target,
        friction=law,
        smoothing_speed=smoothing_speed,
        gravity_input=gravity_input,
    )
    return request.compiled(progress)
