"""Imports run one way: the table of CONTRIBUTING, held against the sources with ast."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "psdmc"

MAY_IMPORT = {
    "robot": set(),
    "dynamics": {"robot"},
    "model": {"robot", "dynamics", "friction"},
    "links": {"robot", "dynamics", "model"},
    "derivation": {"robot", "dynamics", "model"},
    "target": set(),
    "program": {"target"},
    "friction": {"program"},
    "recipes": {"robot", "dynamics", "friction", "model", "program"},
    "functions": {"robot", "dynamics", "model", "program", "recipes"},
    "verification": {"robot", "dynamics", "model", "program", "recipes", "functions"},
    "lower": {"robot", "dynamics", "friction", "model", "program", "recipes", "functions", "target"},
    "backends": {"robot", "program", "friction", "model", "recipes", "functions", "target"},
    "toolchain": {"robot", "backends", "program", "functions", "target"},
}
MAY_IMPORT["model_functions"] = set(MAY_IMPORT) - {"links", "derivation", "verification"}
LEFT_OF_TOOLS = set(MAY_IMPORT) | {"compiler"}
MAY_IMPORT |= {
    "bench": LEFT_OF_TOOLS | {"lower"},
    "calibration": LEFT_OF_TOOLS,
    "export": {"robot", "dynamics", "friction", "model", "links"},
    "frameworks": LEFT_OF_TOOLS - {"model_functions"},
    "report": LEFT_OF_TOOLS | {"bench", "calibration"},
    "emission": {"backends", "friction", "functions", "lower", "model", "target", "toolchain"},
    "compiler": set(MAY_IMPORT) | {"emission"},
    "mujoco": {"robot", "model"},
    "sampling": LEFT_OF_TOOLS | {"lower"},
    "cli": LEFT_OF_TOOLS | {"bench", "calibration", "export", "report", "sampling"},
}

OUTSIDE = {
    "real_arrays": {"numpy"},
    "reproducible": {"numpy"},
    "model_functions": {"numpy"},
    "robot": {"numpy", "pinocchio", "defusedxml", "mujoco", "xacro"},
    "dynamics": {"numpy"},
    "model": {"numpy", "scipy", "pandas", "sympy"},
    "links": {"numpy"},
    "derivation": {"numpy", "scipy"},
    "verification": {"numpy"},
    "program": {"numpy"},
    "friction": {"numpy"},
    "recipes": {"numpy"},
    "functions": {"numpy", "pinocchio"},
    "lower": {"numpy", "scipy"},
    "backends": {"jinja2", "numpy"},
    "toolchain": {"cffi", "numpy", "dask", "xarray"},
    "bench": {
        "numpy",
        "scipy",
        "pinocchio",
        "cffi",
        "jinja2",
        "casadi",
        "mujoco",
        "cmeel",
        "example_robot_data",
    },
    "calibration": {
        "numpy",
        "scipy",
        "pinocchio",
        "coal",
        "cvxpy",
        "cma",
        "rosbags",
        "lz4",
        "backports",
        "compression",
        "pyarrow",
        "cffi",
        "jinja2",
        "cloudpickle",
    },
    "export": {"numpy", "mujoco"},
    "frameworks": {"numpy", "jax", "jaxlib", "torch"},
    "report": {"numpy", "matplotlib", "jinja2", "plotly"},
    "compiler": {"numpy"},
    "mujoco": {"numpy"},
    "sampling": {"numpy", "scipy", "pyarrow", "distributed"},
    "workers": {"distributed"},
    "cli": {"typer", "rich", "numpy"},
}

ROOMS = {
    "robot": {
        "joints": {"placement"},
        "urdf": {
            "coordinates",
            "draft",
            "inertia",
            "joints",
            "limits",
            "load_options",
            "mechanism",
            "placement",
            "xml_text",
        },
        "mjcf": {"inertia", "limits", "urdf"},  # a compiled MJCF becomes a URDF
    },
    "calibration": {
        "logs": set(),
        "columns": {"logs"},
        "identify": {"logs", "columns"},
        "description": {"logs", "identify"},
        "motions": {"logs", "identify"},
        "plant": {"logs", "identify", "motions"},
        "verdict": {
            "logs",
            "columns",
            "identify",
            "campaign_file",
            "sources",
        },  # paths that it is given: 0117
    },
    "lower": {"expanded": set()},
    "backends": {
        room: {path.stem for path in (PACKAGE / "backends").glob("*.py")} | more
        for room, more in {"c": set(), "rust": set(), "cuda": {"c"}}.items()
    },
}
"""Rooms within a stage; files of the stage's own folder may import every room."""

SHARED = {
    "errors",
    "version",
    "files",
    "garbage",
    "progress",
    "workers",
    "real_arrays",
    "reproducible",
}
ENTRY_POINTS = {"__init__", "__main__"}


def modules() -> Iterator[tuple[str, Path]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        inside = path.relative_to(PACKAGE)
        stage = inside.parts[0].removesuffix(".py")
        if stage not in ENTRY_POINTS:
            yield stage, path


@cache
def import_nodes(path: Path) -> list[ast.Import | ast.ImportFrom]:
    return [
        node
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]


def imported(path: Path) -> Iterator[str]:
    for node in import_nodes(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        else:
            assert node.level == 0, f"{path}: relative import"
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names if node.module == "psdmc")


def strange_imports(stage: str, path: Path) -> Iterator[str]:
    for name in imported(path):
        head, _, rest = name.partition(".")
        if head == "psdmc":
            other = rest.split(".")[0]
            if rest and other not in MAY_IMPORT.get(stage, set()) | SHARED | {stage}:
                yield f"{path.relative_to(PACKAGE)} imports {name}: {stage} may not import {other}"
        elif head not in sys.stdlib_module_names and head not in OUTSIDE.get(stage, set()):
            yield f"{path.relative_to(PACKAGE)} imports {head}, which {stage} does not own"


def test_imports_run_one_way():
    found = [fault for stage, path in modules() for fault in strange_imports(stage, path)]
    assert found == []
    assert len(list(modules())) > 300


def test_no_circle_of_files():
    """Also where a name is imported inside a function, or for its type only."""
    names = {module_name(path): path for path in PACKAGE.rglob("*.py")}
    imports = {name: sorted(inside(path, names) - {name}) for name, path in names.items()}
    assert circle(imports) == []


def parsed(path: Path, words: str | re.Pattern[str]) -> ast.Module:
    """The module's syntax tree; an empty one, made faster, if its text has nothing of the regular expression `words`."""
    text = path.read_text(encoding="utf-8")
    return ast.parse(text if re.search(words, text) else "")


def module_name(path: Path) -> str:
    parts = ("psdmc", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def inside(path: Path, names: Collection[str]) -> set[str]:
    """The files of psdmc that a file imports; `from package import module` is an import of the module."""
    found = set()
    for node in import_nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in names}
        else:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                found |= {whole if whole in names else str(node.module)} & set(names)
    return found


def circle(imports: Mapping[str, Sequence[str]]) -> list[str]:
    """Files that import each other in turn, the first one found; none where there is no circle."""
    done: set[str] = set()

    def search(name: str, above: list[str]) -> list[str]:
        if name in above:
            return [*above[above.index(name) :], name]
        if name in done:
            return []
        for other in imports[name]:
            if found := search(other, [*above, name]):
                return found
        done.add(name)
        return []

    return next((found for name in sorted(imports) if (found := search(name, []))), [])


@pytest.mark.parametrize(
    ("imports", "expected"),
    [
        ({"a": ["b", "c"], "b": ["c"], "c": []}, []),
        ({"a": ["b"], "b": ["c"], "c": ["b"]}, ["b", "c", "b"]),
    ],
)
def test_circles_are_found(imports: dict[str, list[str]], expected: list[str]):
    assert circle(imports) == expected


def rooms() -> Iterator[tuple[str, str, Path]]:
    for stage, table in ROOMS.items():
        for room in table:
            for path in sorted((PACKAGE / stage / room).glob("*.py")):
                yield stage, room, path


def test_rooms_import_one_way():
    found = [
        f"{path.relative_to(PACKAGE)} imports {name}: {room} may not"
        for stage, room, path in rooms()
        for name in imported(path)
        if name.startswith(f"psdmc.{stage}.") and name.split(".")[2] not in ROOMS[stage][room] | {room}
    ]
    assert found == []
    assert len(list(rooms())) > 50


@pytest.mark.parametrize("stage", sorted(ROOMS))
def test_every_room_is_in_the_table(stage: str):
    folders = {
        path.name for path in (PACKAGE / stage).iterdir() if path.is_dir() and path.name != "__pycache__"
    }
    assert folders == set(ROOMS[stage])


def test_every_folder_is_a_stage_of_the_table():
    folders = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert folders <= set(MAY_IMPORT)


def test_the_compiler_never_imports_calibration():
    assert {stage for stage, others in MAY_IMPORT.items() if "calibration" in others} == {"report", "cli"}


PICKING = {
    "load.py",
    "store.py",
    "calibrated_json.py",
    "show.py",
    "urdf_words.py",
    "from_source.py",
}
"""Files that may name the key `calibration`: model files are read and written there, the others mean another thing."""
SENTENCES = {"words", "reasons", "doubts", "suspects", "warnings", "notes", "visibility"}
"""Attributes that hold sentences for people."""


def test_a_calibration_is_read_as_calibrated_only():
    """No module picks a calibration out of plain values by its key."""
    keys = {
        path.name
        for _, path in modules()
        for node in ast.walk(parsed(path, "calibration"))
        if isinstance(node, ast.Constant) and node.value == "calibration"
    }
    assert keys <= PICKING | {"calibrate.py"}  # of which joints it is, in words
    assert "load.py" in keys


def test_nothing_is_decided_by_a_sentence():
    """No comparison with, or search in, an attribute that holds sentences: their codes are for that."""
    found = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}"
        for _, path in modules()
        for node in ast.walk(parsed(path, "|".join(SENTENCES)))
        for part in searched(node)
        if isinstance(part, ast.Attribute) and part.attr in SENTENCES
    ]
    assert found == []


def searched(node: ast.AST) -> list[ast.expr]:
    """What an expression compares or searches in."""
    if isinstance(node, ast.Compare):
        return [node.left, *node.comparators]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        return [node.func.value] if node.func.attr in ("startswith", "endswith", "find", "index") else []
    return []


def test_no_vague_module_names():
    vague = {"utils", "helpers", "common", "build", "misc"}
    assert not [
        path
        for _, path in modules()
        if path.parent.name in vague or path.stem in {"utils", "helpers", "common"}
    ]


MACHINE = re.compile(
    r"-m(arch|cpu|fpu|tune|float-abi)\b|__(AVX|SSE|ARM|NEON|aarch64)|__builtin_ia32|cortex|x86[-_]64|\bavx|vector_size\([0-9]",
    re.IGNORECASE,
)
"""What only machines, and compilers that are told of one, are called by."""

MAY_NAME_MACHINES = {
    "adapters/casadi.c.jinja": "a comment: how to compile the file by hand",
    "adapters/fmu_pack.py.jinja": "the names that FMI has for platforms",
    "report/bench_method.html.jinja": "how instructions are counted, for readers",
    "trig/preamble.jinja": "constraints of inline assembly: how GCC is told that a value is in a register",
}


def said(path: Path, words: re.Pattern[str]) -> Iterator[str]:
    """Strings of a module that are no docstrings, if it has any of `words`; all of a template."""
    if path.suffix != ".py":
        yield path.read_text(encoding="utf-8")
        return
    tree = parsed(path, words)
    documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documents:
            yield node.value


def machines(path: Path) -> list[str]:
    return [found[0] for text in said(path, MACHINE) for found in MACHINE.finditer(text)]


def test_no_file_but_the_targets_names_machines():
    target = PACKAGE / "target"
    templates = PACKAGE.parent / "templates"
    files = [path for _, path in modules() if target not in path.parents]
    files += sorted(templates.rglob("*.jinja"))
    named = {str(path.relative_to(PACKAGE.parent)): found for path in files if (found := machines(path))}

    assert set(named) == {f"templates/{name}" for name in MAY_NAME_MACHINES}
    assert any(machines(path) for path in target.glob("*.py")), "the words are not those that targets use"


C_TEXT = re.compile(
    r"#include|#define|const (real|double|float)\b|\b(double|float|real|char) \*|size_t|static inline|SPLAT"
    r"|\bvoid [a-z]|/\*|\w\);$",
    re.MULTILINE,
)
WRITE_C = {
    "backends/c": "the back end of C",
    "backends/cuda": "CUDA is C++ around the bodies of C",
    "toolchain": "compiles",
    "bench/rivals": "other programs' C and C++ around theirs and psdmc's",
    "calibration/identify/state_friction.py": "compiles the simulation of a friction law with a state",
}
"""Where C text is, and why."""


def test_no_file_but_the_back_end_of_c_writes_c():
    named = {
        path.relative_to(PACKAGE).as_posix()
        for _, path in modules()
        if any(C_TEXT.search(text) for text in said(path, C_TEXT))
    }

    assert [name for name in sorted(named) if not name.startswith(tuple(WRITE_C))] == []
    assert all(any(name.startswith(place) for name in named) for place in WRITE_C)
    assert len([name for name in named if name.startswith("backends/c")]) > 5


WEIGHING = ("lower", "program", "backends", "toolchain")
"""Stages that choose by what arithmetic costs, and write or compile C."""

COSTS = re.compile(
    r"latency|sincos_cost|angle_cost|crowded|worth_two|registers|cache_line|vector_bytes|march|native_flags",
    re.IGNORECASE,
)


def test_what_arithmetic_costs_is_a_constant_of_targets_alone():
    """By name: a module that chooses by such a figure takes it from its argument."""
    for stage, path in modules():
        if stage not in WEIGHING:
            continue
        for node in parsed(path, COSTS).body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            names = [name.id for name in targets if isinstance(name, ast.Name)]
            assert not any(COSTS.search(name) for name in names), f"{path.relative_to(PACKAGE)}: {names}"


def test_a_module_that_runs_runs_at_its_end():
    """What stands behind the call of main() would not be defined yet."""
    for _, path in modules():
        body = parsed(path, "__main__").body
        runs = [
            k
            for k, node in enumerate(body)
            if isinstance(node, ast.If) and "__main__" in ast.unparse(node.test)
        ]
        assert runs in ([], [len(body) - 1]), path.relative_to(PACKAGE)
