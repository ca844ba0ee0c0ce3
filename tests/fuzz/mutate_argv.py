"""Command lines as JSON lists of words: commands, options, values. Files are those of target_commands.py."""

from __future__ import annotations

import json
from random import Random

from nasty import NUMBERS, TEXTS, number, text

FILES = (
    *(
        "two_link.toml",
        "branches.toml",
        "arm.urdf",
        "hand.urdf",
        "legs.urdf",
        "two_link.npz",
        "arm.npz",
        "hand.npz",
        "legs.npz",
        "broken.npz",
        "text.npz",
        "empty",
        "log.csv",
        "log.npz",
    ),
    *(
        "campaign",
        "campaign/campaign.toml",
        "plant.toml",
        "package",
        "missing",
        "missing/x.npz",
        ".",
        "no suffix",
    ),
)
COMMANDS = ("derive", "show", "check", "emit-c", "build", "bench", "excite", "simulate", "calibrate")
VALUES: dict[str, tuple[str, ...]] = {
    "--output": ("new.npz", "new", "two_link.npz", "missing/x.npz", "empty", "package", "é.npz", "a b", "new.csv"),
    "--base": ("base", "base_link", "arm", "link1", "palm", "trunk", "thumb", "nowhere", ""),
    "--tip": ("tip", "arm", "link1", "thumb", "nail", "palm", "left", "camera", "nowhere", ""),
    "--lock": ("wrist=0.5", "close=0.01", "bend=0", "curl=1e300", "hip_l=-0.3", "tip=0", "wrist=", "=1", "wrist", "a=b=1",
               "wrist=nan", "wrist=1,close=0", "root_joint=0", "second=5e-324", "nowhere=0"),
    "--frames": ("thumb,nail", "palm", "left,right", "left,left", "camera", "base", ",", "nowhere", "universe"),
    "--with": ("casadi", "casadi,casadi", "x", ""),
    "--target": ("native", "cortex-m4f", "avx2", "x", ""),
    "--estimator": ("mass", "inertia", "all", "", "mass,inertia"),
    "--friction": ("coulomb,viscous,offset", "coulomb,viscous^0.5", "viscous", "x", ",", "coulomb,viscous^nan"),
    "--split": ("0.3", "0.15,40", "1", "nan", "0.1,1e9", ",", "x"),
    "--validate": ("log.csv", "log.npz", "campaign", "missing", "empty"),
    "--topic": ("/joint_states", "x", "\u00e9", ""),
    "--warm": ("0", "5", "-1", "1e9", "nan", "x"),
    "--joint-map": ("shoulder=elbow,elbow=shoulder", "x=shoulder", "=", "shoulder=", "a=b=c"),
    "--cutoff": ("8", "0", "nan", "1e300"),
    "--drive-inertia": ("all", "0", "1,2", "0.1,-1", "nan", "1e300,1e300", "1,,2", ",", "x"),
    "--assume-zero": ("link1:mx", "shoulder:Ixz@com", "link9:mx", "link1", ":", "link1:", "link1:mx,link1:mx", "@com"),
    "--snap": ("0", "1e-5", "0.1", "0.2", "-1", "nan", "inf", "1e-400"),
    "--lowering": ("auto", "factored", "expanded", "fast", ""),
    "--functions": ("gravity", "inverse_dynamics", "jerk", "gravity,gravity", ",", "gravity,jacobian", "regressor"),
    "--real": ("float64", "float32", "half", ""),
    "--trig": ("inline", "libm", "freestanding", "cordic"),
    "--name": ("arm", "time", "sin", "M_PI", "int", "a-b", "1a", "é", "", "test", "_", "a" * 300, "*/", "EOF"),
    "--robot": ("two_link.toml", "arm.urdf", "missing", "empty", "broken.npz"),
    "--duration": ("0.1", "1", "-1", "1e9", "nan", "inf", "x", "1e300", "1e-300"),
    "--harmonics": ("1", "0", "-3", "1000000", "x", "99999999999999999999"),
    "--seconds": ("1", "0.5", "nan", "-1", "x"),
    "--seed": ("0", "-1", "99999999999999999999", "x", "1.5"),
    "--acceleration": ("1", "0.1", "0", "nan", "inf", "1e300", "x"),
    "--workers": ("1", "0", "-1", "x"),
    "--rounds": ("1", "0", "x"),
    "--torque-constants": ("shoulder=1,elbow=2", "shoulder=0,elbow=1", "shoulder=nan,elbow=1", "elbow=1",
                           "=", "a", "a=b=1", "shoulder=-1,elbow=1e300", ","),
    "--report": ("new.html", "missing/x.html", "empty", "."),
    "--json": ("new.json", "missing/x.json"),
    "--actuators": ("new", "empty"),
}  # fmt: skip
"""Never a place outside the folder that the target makes; --seconds, --workers and --rounds stay small."""

FLAGS = ("--debug", "--version", "--help", "--no-expand", "--expand", "--terms", "--cost", "--force", "--counts",
         "--log-det", "--condition", "--ideal", "--harness", "--physical",
         "--floating", "--payload", "--bodies", "--edited", "--keep", "--describe", "--", "-o", "-h", "-x")  # fmt: skip
SLOW = ("--seconds", "--workers", "--rounds")


def mutate_argv(data: bytes, rng: Random) -> bytes:
    words = words_of(data)
    if words is None:
        words = []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        words = _one_edit(words, rng)
    return json.dumps(words).encode()


def words_of(data: bytes) -> list[str] | None:
    """The words; None where these bytes are no list of them."""
    try:
        words = json.loads(data)
    except (ValueError, RecursionError):
        return None
    return words if isinstance(words, list) and all(isinstance(word, str) for word in words) else None


def _one_edit(words: list[str], rng: Random) -> list[str]:
    found, at = list(words), rng.randrange(len(words) + 1)
    choice = rng.randrange(8)
    if choice < 3:
        option = rng.choice(list(VALUES))
        found[at:at] = [option, _value(option, rng)]
    elif choice == 3:
        found.insert(at, rng.choice(FLAGS))
    elif choice == 4 and found:
        del found[rng.randrange(len(found))]
    elif choice == 5 and found:
        found[rng.randrange(len(found))] = rng.choice((*FILES, *COMMANDS))
    elif choice == 6:
        found.insert(at, rng.choice((rng.choice(FILES), text(rng))))
    else:
        _revalue(found, rng)
    return found


def _value(option: str, rng: Random) -> str:
    if option in SLOW or option in ("--output", "--report", "--json", "--actuators") or rng.random() < 0.6:
        return rng.choice(VALUES[option])
    return rng.choice((rng.choice(NUMBERS), rng.choice(TEXTS), number(rng)))


def _revalue(words: list[str], rng: Random) -> None:
    """Another value for an option that is there."""
    places = [k for k, word in enumerate(words[:-1]) if word in VALUES]
    if places:
        at = rng.choice(places)
        words[at + 1] = _value(words[at], rng)
