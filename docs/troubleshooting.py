"""Messages of psdmc with cause and remedy: python docs/troubleshooting.py writes docs/how-to/troubleshooting.md.

tests/docs/test_troubleshooting.py types each command and compares what psdmc prints."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).parent / "how-to/troubleshooting.md"


@dataclass(frozen=True, slots=True)
class Entry:
    """A message that a user meets.

    part     text that the message contains; each … stands for a value of the user's
    cause    why psdmc prints it
    remedy   what to type or to change
    typed    a command that prints it, on the files that the test makes
    status   the command's exit status
    """

    part: str
    cause: str
    remedy: str
    typed: str
    status: int = 2


ROBOT_FILES = (
    Entry("no such file", "The path is wrong.", "Check the path.", "derive nothing.urdf"),
    Entry(
        "the file is empty", "The robot file has no content.", "Export the robot again.", "derive empty.urdf"
    ),
    Entry(
        "not well-formed XML",
        "A tag is not closed, or the file is cut.",
        "Read the line that the message names.",
        "derive broken.urdf",
    ),
    Entry(
        "the root element is",
        "The file is XML, but it is neither a URDF nor an MJCF.",
        "Give a URDF, MJCF, xacro or DH file.",
        "derive other.urdf",
    ),
    Entry(
        "an SDF, which",
        "SDF files are not supported.",
        "Convert the file to URDF or MJCF.",
        "derive world.sdf",
    ),
    Entry(
        "not a TOML file",
        "The DH table has a syntax error.",
        "Correct the line that the message names.",
        "derive broken.toml",
    ),
    Entry(
        "a model, which is derived already",
        "The input of `derive` is a model file, not a robot file.",
        "Give a robot file to `derive`, or give the model to `show`, `check` or `emit-c`.",
        "derive arm.npz",
    ),
    Entry(
        "expected no less than zero",
        "A mass or moment of inertia is negative.",
        "Correct the number.",
        "derive negative.urdf",
    ),
    Entry(
        "expected a finite number",
        "A number has a comma, a unit or a typing error.",
        "Write numbers with a decimal point, in SI units.",
        "derive comma.urdf",
    ),
    Entry(
        "not physical",
        "No rigid body can have the inertia in the file, often because of wrong axes or units.",
        "Correct the inertia. You may ignore the note if you need only torques.",
        "derive unphysical.urdf -o unphysical.npz",
        0,
    ),
    Entry(
        "is not supported",
        "psdmc does not model this type of joint.",
        "Use a type that the hint lists.",
        "derive screw.urdf",
    ),
    Entry(
        "does not exist",
        "A joint names a link that is not in the file.",
        "Correct the name of the link.",
        "derive child.urdf",
    ),
    Entry(
        "which is no movable joint",
        "`<mimic>` names a fixed joint or no joint.",
        "Correct `<mimic joint=...>`.",
        "derive mimic.urdf",
    ),
    Entry(
        "expected 0 to 0.1",
        "The angle of `--snap` is negative or over 0.1 rad.",
        "Leave out `--snap`, or give an angle from 0 to 0.1 rad.",
        "derive arm.urdf --snap 2",
    ),
    Entry(
        "has no <inertial>: treated as massless",
        "A moving link has no inertia.",
        "Add `<inertial>` to the link, or keep its inertia as an unknown with `--unknown LINK`.",
        "derive bare.urdf -o bare.npz",
        0,
    ),
    Entry(
        "is no link",
        "A name in `--frames` is not a link of the robot file.",
        "Choose one of the links that the hint lists.",
        "derive arm.urdf --frames hand",
    ),
    Entry(
        "link '…' does not exist",
        "`--tip` or `--base` names no link.",
        "Choose one of the links that the hint lists.",
        "derive arm.urdf --tip hand",
    ),
    Entry(
        "--lock '…' is no JOINT=VALUE",
        "The locked joint has no value.",
        "Write `--lock elbow=0.5`, in rad or m.",
        "derive arm.urdf --lock elbow",
    ),
    Entry(
        "to be locked",
        "`--lock` names a joint that is not in the file.",
        "Choose one of the joints that the hint lists.",
        "derive arm.urdf --lock wrist=0",
    ),
    Entry(
        "is not three finite numbers",
        "The value of `--gravity` is not three numbers in m/s².",
        "Write `--gravity 0,0,-9.81`.",
        "derive arm.urdf --gravity 9.81",
    ),
    Entry(
        "cut a chain out of it",
        "`--floating` works only for the whole robot, not for a chain.",
        "Leave out `--base` and `--tip`.",
        "derive arm.urdf --floating --tip fore",
    ),
    Entry(
        "--floating frees the root link of a URDF",
        "The file is a DH table, which has a fixed base.",
        "Give a URDF or an MJCF.",
        "derive examples/robots/kr6.toml --floating",
    ),
    Entry(
        "--base and --tip name links of a URDF",
        "The file is a DH table, which has only one chain.",
        "Leave out `--base` and `--tip`.",
        "derive examples/robots/kr6.toml --tip link3",
    ),
    Entry(
        "redundant rows:",
        "A closed loop prevents motions that joints or other rows of the loop prevent already.",
        "Leave out the rows that the message names ([Closed loops](loops.md)).",
        "derive arm.urdf --loops loop.toml",
    ),
    Entry(
        "is not of the form NAME:=VALUE",
        "A word after the file is no xacro argument.",
        "Write `name:=value` after the file.",
        "derive arm.urdf name=x",
    ),
)

MODELS = (
    Entry(
        "model file",
        "You gave a robot file to a command that needs a model file.",
        "Run `psdmc derive` first.",
        "check arm.urdf",
    ),
    Entry(
        "no such file",
        "The model file is not at this path.",
        "Run `psdmc derive`, or correct the path.",
        "show arm9.npz",
    ),
    Entry(
        "are several questions",
        "`show` accepts only one of `--terms`, `--cost` and `--latex` per call.",
        "Call `show` once for each option.",
        "show arm.npz --cost --terms",
    ),
    Entry(
        "is of models",
        "You gave a robot file, but `--cost` and `--terms` need a model file.",
        "Run `psdmc derive` first.",
        "show arm.urdf --cost",
    ),
)

PACKAGES = (
    Entry(
        "is not known",
        "`--functions` names no function of psdmc.",
        "Take the name that the hint suggests, or see [Functions](../functions.md).",
        "emit-c arm.npz --functions inverse_dynamic",
    ),
    Entry(
        "no function is named",
        "The option `--functions` has no value.",
        "Write `--functions default`, `--functions all`, or names of functions.",
        "emit-c arm.npz --functions ,",
    ),
    Entry(
        "moves no inertia",
        "A joint moves only links without inertia, so forward dynamics does not exist.",
        "Add `<inertial>` to a link that the joint moves, or leave out `forward_dynamics`.",
        "emit-c bare.npz -o bare",
    ),
    Entry(
        "did not write the files in this folder",
        "The output folder contains files that psdmc did not write.",
        "Choose another folder, or add `--force`.",
        "emit-c arm.npz -o mine",
    ),
    Entry(
        "real is '…'",
        "psdmc does not know the value of `--real`.",
        "Choose `float64` or `float32`.",
        "emit-c arm.npz --real float16",
    ),
    Entry(
        "target is '…'",
        "psdmc does not know the value of `--target`.",
        "Choose a target that the hint lists. The target `scalar` works with any C99 compiler.",
        "emit-c arm.npz --target riscv",
    ),
    Entry(
        "there is no adapter",
        "psdmc has no adapter with the name that you gave to `--with`.",
        "Choose a name that the hint lists ([all adapters](adapters.md)).",
        "emit-c arm.npz --with acados",
    ),
    Entry(
        "CasADi's numbers are double",
        "CasADi cannot call float32 code.",
        "Leave out `--real float32`.",
        "emit-c arm.npz --with casadi --real float32",
    ),
    Entry(
        "no emitted package",
        "The folder that you gave to `build` is not a C package.",
        "Run `psdmc emit-c` first.",
        "build mine",
    ),
)

LOGS = (
    Entry(
        "no such file",
        "The log's path is wrong.",
        "Check the path.",
        "calibrate arm.npz log9.csv -o found.npz",
    ),
    Entry(
        "time_s",
        "The log has no column of times in seconds.",
        "Rename the column, or draft a description: `calibrate --describe`.",
        "calibrate arm.npz words.csv -o found.npz",
    ),
    Entry(
        "write JOINT=NUMBER",
        "A value of `--torque-constants` does not name a joint.",
        "Write `--torque-constants shoulder=0.1`, in N m/A at the joint, gear included.",
        "calibrate arm.npz words.csv -o found.npz --torque-constants 3",
    ),
    Entry(
        "without limits to move within",
        "`excite` needs limits of speed and acceleration.",
        "Give limits in rad/s^2 and rad/s: `--acceleration 5 --speed shoulder=2,elbow=2`.",
        "excite arm.npz -o campaign",
    ),
    Entry(
        "would overwrite",
        "Output and input are the same file.",
        "Choose another name for `-o`.",
        "calibrate arm.npz words.csv -o arm.npz",
    ),
    Entry(
        "holds no calibration that torques can be predicted from",
        "The model that you gave to `validate` is not calibrated.",
        "Run `psdmc calibrate` first.",
        "validate arm.npz words.csv",
    ),
    Entry(
        "different robots:",
        "The two models of `compare` have other joints, axes or link frames.",
        "Compare models of one robot.",
        "compare arm.npz examples/robots/scara.toml",
    ),
)

ARRAYS = (
    Entry(
        "has shape …, expected (...,",
        "The last axis of the array does not have one entry per joint.",
        "Give an array of shape (..., n) for n joints.",
        "robot.gravity([0, 0, 0])",
    ),
    Entry(
        "shapes do not broadcast",
        "q, qd and qdd have different numbers of states.",
        "Give q, qd and qdd the same number of states.",
        "robot.inverse_dynamics(np.zeros((3, 2)), np.zeros((4, 2)), np.zeros(2))",
    ),
    Entry(
        "expected real numbers",
        "The array contains complex numbers or strings.",
        "Give an array of floats.",
        "robot.gravity(['a', 'b'])",
    ),
    Entry(
        "theta_b has shape",
        "theta_b does not have one value per base parameter.",
        "Compute theta_b with `model.theta_for`, or pass `model.theta_b`.",
        "robot.gravity([0, 0], theta_b=[1.0])",
    ),
    Entry(
        "out for … has shape",
        "The array that you passed as `out` has the wrong shape.",
        "Pass an array with the shape in the hint.",
        "robot.gravity(np.zeros((2, 2)), out=np.zeros(2))",
    ),
    Entry(
        "is not positive definite at mu = 0",
        "The active contacts or closed loops block more motions than the robot has.",
        "Pass `mu=1e-6`, or activate fewer contacts ([redundant contacts](contacts.md#redundant-contacts)).",
        "scara.constrained_forward_dynamics(*np.zeros((3, 4)), [1])",
    ),
    Entry(
        "is a masked array",
        "The array is a NumPy masked array.",
        "Remove the masked states, or fill them with numbers.",
        "robot.gravity(np.ma.masked_array([0.0, 1.0], [True, False]))",
    ),
    Entry(
        "q has columns",
        "The column names of the data frame are not the robot's joint names.",
        "Rename the columns, or pass `.to_numpy()`.",
        "robot.gravity(pd.DataFrame({'a': [0.0], 'b': [0.0]}))",
    ),
    Entry(
        "was given where a model is expected",
        "You passed something other than a model, such as the path of a robot file.",
        "Call `psdmc.derive` first, and pass its result.",
        "psdmc.compile('examples/robots/two_link.toml')",
    ),
    Entry(
        "payload mass is …",
        "The mass of the load is negative.",
        "Give a positive mass in kg.",
        "model.with_payload(-1, [0, 0, 0])",
    ),
    Entry(
        "masses has shape",
        "The arrays for `theta_for` do not have one row per body.",
        "Give one row per link of `model.link_names`.",
        "model.theta_for([1.0], [[0, 0, 0]], [np.eye(3)])",
    ),
)
"""Of Python: `typed` is an expression."""

GROUPS = {
    "Robot files": ROBOT_FILES,
    "Models": MODELS,
    "C packages": PACKAGES,
    "Logs and calibration": LOGS,
    "Arrays in Python": ARRAYS,
}


def page() -> str:
    """The page's text."""
    parts = [
        "# Troubleshooting by message",
        "If psdmc printed an error or a warning, search this page for a part of the message. "
        "The tables give the cause, and what to do.",
        "psdmc prints each error as one line and a hint. "
        "After wrong input, a command ends with exit status 2 ([all exit statuses](../files.md)). "
        "In Python, psdmc raises `psdmc.InputError`, `psdmc.DerivationError` or `psdmc.ToolchainError` with the message.",
    ]
    for title, entries in GROUPS.items():
        rows = ["| message contains | cause | what to do |", "|---|---|---|"]
        rows += [f"| `{entry.part}` | {entry.cause} | {entry.remedy} |" for entry in entries]
        parts += [f"## {title}", "\n".join(rows)]
    return "\n\n".join([*parts, AFTER])


AFTER = """## When nothing here fits

- Run `psdmc doctor` to see which compilers and optional packages psdmc finds.
- Run `psdmc COMMAND --help` to see all options of a command, with units and defaults.
- Run `psdmc show FILE` to see the joints and masses of a robot file, or the joints, gravity and base parameters of a model.
- If a message begins with "internal error", psdmc has a bug. Report the message, with the robot file or log.
"""

if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
