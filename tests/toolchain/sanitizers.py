"""The tools that emitted C is put under: dynamic ones run the stress program, static ones read the sources.

`look` puts one package under one tool and returns what was found; a tool that is not installed is said, not counted.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path

from c_warnings import EXTRA, STRICT
from direct import write_sources
from stress import RUNTIME, stress_program

from psdmc.backends.c.package import PackageView

WARNINGS = [flag for flag in STRICT if flag != "-Werror"] + EXTRA
UNDEFINED = "-fsanitize=undefined,float-cast-overflow -fno-sanitize-recover=all"
SECONDS = 1500

CLANG_TIDY = (
    "clang-analyzer-*,bugprone-*,cert-*,misc-redundant-expression,misc-misplaced-const,portability-*,"
    # products of two small constants as size_t: nothing to widen;
    "-bugprone-implicit-widening-of-multiplication-result,"
    # the analyzer does not follow lanes of a vector (memcheck does);
    "-clang-analyzer-core.uninitialized*,-clang-analyzer-core.UndefinedBinaryOperatorResult,"
    # swapped arguments: q, qd and qdd are of one type by nature; .inc files hold the bodies; names of
    # guards and macros are the robot's; DCL37-C is the same check under another name
    "-bugprone-easily-swappable-parameters,-bugprone-suspicious-include,-bugprone-reserved-identifier,-cert-dcl37-c"
)
NO_LANES = [
    f"--extra-arg={word}"
    for word in ("-Xclang", "-analyzer-config", "-Xclang", "core.CallAndMessage:ArgInitializedness=false")
]
"""Nor does it follow lanes into arguments of functions; the rest of that check stays."""
CPPCHECK = [
    "--std=c99",
    "--enable=warning,performance,portability",
    "--quiet",
    "--error-exitcode=1",
    "-D__GNUC__=12",
    "-D__SSE2__",
    "--suppress=shiftTooManyBitsSigned",
]


@dataclass(frozen=True, slots=True)
class Tool:
    """One build and what runs it.

    programs  what must be installed
    flags     of the compiler; '' for tools that do not compile
    runner    words before the program, or 'static' tools' own command
    """

    name: str
    programs: tuple[str, ...]
    flags: str = ""
    runner: str = ""
    is_static: bool = False


DYNAMIC = (
    Tool(
        "ASan and UBSan, gcc -O0, widest vectors",
        ("gcc",),
        f"-O0 -march=native -DHEAP -fsanitize=address {UNDEFINED}",
    ),
    Tool(
        "ASan and UBSan, gcc -O0, no vectors",
        ("gcc",),
        f"-O0 -DNO_VECTORS -DHEAP -fsanitize=address {UNDEFINED}",
    ),
    Tool("ASan, gcc -O2, SSE2", ("gcc",), "-O2 -DHEAP -fsanitize=address -fno-sanitize-recover=all"),
    Tool(
        "ASan and UBSan, clang -O1, AVX2",
        ("clang",),
        f"-O1 -march=x86-64-v3 -DHEAP -fsanitize=address {UNDEFINED}",
    ),
    Tool("TSan, gcc -O1, widest vectors", ("gcc",), "-O1 -march=native -DTHREADS -fsanitize=thread -pthread"),
    Tool("TSan, clang -O1, AVX2", ("clang",), "-O1 -march=x86-64-v3 -DTHREADS -fsanitize=thread -pthread"),
    Tool(
        "memcheck, gcc -O2, AVX2",
        ("gcc", "valgrind"),
        "-O2 -march=x86-64-v3 -DHEAP",
        "valgrind -q --error-exitcode=9 --leak-check=full",
    ),
    Tool("guard pages, gcc -O3, widest vectors", ("gcc",), "-O3 -march=native"),
    Tool("guard pages, gcc -O3, SSE2", ("gcc",), "-O3"),
    Tool("guard pages, gcc -O2, no vectors", ("gcc",), "-O2 -DNO_VECTORS"),
    Tool("guard pages, clang -O3, widest vectors", ("clang",), "-O3 -march=native"),
)
"""valgrind 3.19 does not know AVX-512."""

STATIC = (
    Tool(
        "gcc -fanalyzer",
        ("gcc",),
        # On vectors it does not end; it does not see that a loop fills the sines (memcheck does).
        "-O0 -DNO_VECTORS -fanalyzer -Wno-analyzer-use-of-uninitialized-value -Werror",
        is_static=True,
    ),
    Tool("gcc, all warnings", ("gcc",), "-O2 -march=native -Werror", is_static=True),
    Tool("gcc, all warnings, no vectors", ("gcc",), "-O2 -DNO_VECTORS -Werror", is_static=True),
    Tool("clang, all warnings", ("clang",), "-O2 -march=native -Werror", is_static=True),
    Tool("clang, all warnings, no vectors", ("clang",), "-O2 -DNO_VECTORS -Werror", is_static=True),
    Tool("clang-tidy", ("clang-tidy",), runner="clang-tidy", is_static=True),
    Tool("cppcheck", ("cppcheck",), runner="cppcheck", is_static=True),
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """missing: a program that is not installed; findings: what the tool said, '' where nothing."""

    tool: str
    missing: str = ""
    calls: int = 0
    findings: str = ""


def look(tool: Tool, package: PackageView, folder: Path) -> Outcome:
    """One package under one tool, in a folder of its own."""
    missing = next((program for program in tool.programs if shutil.which(program) is None), "")
    if missing:
        return Outcome(tool.name, missing=missing)
    write_sources(package, folder)
    (folder / "stress.c").write_text(stress_program(package))
    for header in RUNTIME:
        (folder / header.name).write_text(header.read_text())
    return _read(tool, package, folder) if tool.is_static else _run(tool, package, folder)


def _flags(tool: Tool, package: PackageView) -> list[str]:
    return tool.flags.replace("-DNO_VECTORS", f"-D{package.robot}_NO_VECTORS").split()


def _run(tool: Tool, package: PackageView, folder: Path) -> Outcome:
    sources = [str(folder / source) for source in ("stress.c", *package.sources)]
    words = [
        tool.programs[0],
        "-std=gnu11",
        "-g",
        "-ffp-contract=fast",
        *_flags(tool, package),
        f"-I{folder}/include",
    ]
    built = _done([*words, *sources, "-lm", "-o", str(folder / "stress")])
    if re.search(r"cannot find \S*libclang_rt", built.stderr):
        return Outcome(tool.name, missing="clang's sanitizer runtime")
    if built.returncode != 0:
        return Outcome(tool.name, findings=f"does not compile: {built.stderr}")
    ran = _done([*tool.runner.split(), str(folder / "stress")])
    counted = re.search(r"calls (\d+) differences 0$", ran.stdout.strip())
    said = ran.stderr.strip()
    if ran.returncode != 0 or counted is None or said:
        said = f"status {ran.returncode}: {ran.stdout.strip()} {said}"
    return Outcome(tool.name, calls=int(counted[1]) if counted else 0, findings=said)


def _read(tool: Tool, package: PackageView, folder: Path) -> Outcome:
    findings = []
    for source in package.sources:
        include = f"-I{folder}/include"
        compiled = [
            tool.programs[0],
            *WARNINGS,
            *_flags(tool, package),
            include,
            "-c",
            "-o",
            str(folder / "x.o"),
        ]
        words = {
            "clang-tidy": [
                "clang-tidy",
                "--quiet",
                f"--checks={CLANG_TIDY}",
                "--warnings-as-errors=*",
                *NO_LANES,
            ],
            "cppcheck": ["cppcheck", *CPPCHECK, f"-I{folder}/include", f"-I{folder}/src"],
        }.get(tool.runner, compiled)
        last = ["--", "-std=c99", include] if tool.runner == "clang-tidy" else []
        done = _done([*words, str(folder / source), *last])
        if done.returncode != 0 or (not last and done.stderr.strip()):
            findings.append(f"{source}: {done.stdout.strip()} {done.stderr.strip()}")
    return Outcome(tool.name, findings="\n".join(findings))


def _done(words: list[str]) -> subprocess.CompletedProcess[str]:
    """What a command ended with; one that does not end in time is ended with all that it started, and has failed."""
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            said = process.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return subprocess.CompletedProcess(words, 1, "", f"{words[0]}: not done in {SECONDS} s")
        return subprocess.CompletedProcess(words, process.returncode, *said)
