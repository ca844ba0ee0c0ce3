"""Settings of NumPy and OpenBLAS that make this processor compute as another one does.

    python tests/machines.py names                 the settings that this processor can take, one a line
    python tests/machines.py chosen-by COMMIT      the setting that a commit's hash chooses
    python tests/machines.py run NAME COMMAND ...  run a command under a setting, with an empty compile cache

`run` first asks a process under the setting what NumPy and OpenBLAS do there, and fails if the setting is without effect.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

DISABLE = "NPY_DISABLE_CPU_FEATURES"
TUNABLES = "GLIBC_TUNABLES"
"""By which the C library computes sines without fused multiply-add, as on processors before 2013."""
FEATURES = "import json, numpy; print(json.dumps(numpy.show_config(mode='dicts')['SIMD Extensions'].get('found', [])))"


def _found() -> tuple[str, ...]:
    """Return the names of NumPy's `__cpu_dispatch__` that this processor has, also in a process that has some disabled."""
    plain = {key: value for key, value in os.environ.items() if key != DISABLE}
    run = subprocess.run(
        [sys.executable, "-c", FEATURES], env=plain, capture_output=True, text=True, check=True
    )
    return tuple(json.loads(run.stdout))


FOUND = _found()


def settings_of(machine: str, found: tuple[str, ...], cores: int) -> dict[str, dict[str, str]]:
    """Return every setting that can change something on such a machine: its name and its environment variables."""
    avx512 = [name for name in found if name == "X86_V4" or name.startswith("AVX512")]
    avx2 = {"X86_V3", "AVX2"}.intersection(found)
    kernels = ["SkylakeX"] * bool(avx512) + ["Haswell"] * bool(avx2) + ["Nehalem"] * (machine == "x86_64")
    settings = {kernel.lower(): {"OPENBLAS_CORETYPE": kernel} for kernel in kernels}
    if avx2 and platform.libc_ver()[0] == "glibc":
        settings["nehalem"][TUNABLES] = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"
    if avx512:
        settings["numpy-without-avx512"] = {DISABLE: " ".join(avx512)}
    if found:
        settings["numpy-baseline"] = {DISABLE: " ".join(found)}
    if cores > 1:
        settings["two-threads"] = {"OPENBLAS_NUM_THREADS": "2"}
    one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return {name: one_thread | setting for name, setting in settings.items()}


SETTINGS: dict[str, dict[str, str]] = settings_of(platform.machine(), FOUND, len(os.sched_getaffinity(0)))

ASK = """
import ctypes, hashlib, json, math, sys
import numpy, scipy.linalg
sines = hashlib.sha256(repr([math.sin(0.001 * k) for k in range(20_000)]).encode()).hexdigest()
kernels, threads = [], []
with open("/proc/self/maps") as maps:
    libraries = sorted({line.split()[-1] for line in maps if "openblas" in line.rsplit("/", 1)[-1]})
for library in map(ctypes.CDLL, libraries):
    for start in ("scipy_openblas", "openblas"):
        for end in ("64_", ""):
            if hasattr(library, f"{start}_get_corename{end}"):
                corename = getattr(library, f"{start}_get_corename{end}")
                corename.restype = ctypes.c_char_p
                kernels.append(corename().decode())
                threads.append(getattr(library, f"{start}_get_num_threads{end}")())
print(json.dumps([numpy.show_config(mode="dicts")["SIMD Extensions"].get("found", []), kernels, threads, sines]))
"""


def _asked(setting: dict[str, str]) -> tuple[list[str], list[str], list[int], str]:
    """Return NumPy's features, OpenBLAS's kernels and threads, and a digest of sines, of a process under the setting."""
    command = [sys.executable, "-c", ASK]
    run = subprocess.run(command, env=os.environ | setting, capture_output=True, text=True, check=True)
    features, kernels, threads, sines = json.loads(run.stdout)
    return features, kernels, threads, sines


def faults_of(setting: dict[str, str]) -> list[str]:
    """Return how a process under the setting differs from what the setting asks for: nothing, if it takes effect."""
    features, kernels, threads, sines = _asked(setting)
    disabled = setting.get(DISABLE, "").split()
    wanted_kernel, wanted_threads = setting.get("OPENBLAS_CORETYPE"), setting.get("OPENBLAS_NUM_THREADS")
    faults = [
        f"NumPy found no feature {name} that could be disabled" for name in disabled if name not in FOUND
    ]
    faults += [f"NumPy still uses {name}" for name in disabled if name in features]
    if wanted_kernel and not kernels:
        faults += ["NumPy and SciPy use no OpenBLAS"]
    if wanted_kernel:
        faults += [f"OpenBLAS uses kernels for {kernel}" for kernel in kernels if kernel != wanted_kernel]
    if TUNABLES in setting and sines == _asked({TUNABLES: ""})[3]:
        faults += ["the C library's sines are the same"]
    if wanted_threads:
        faults += [f"OpenBLAS uses {count} threads" for count in threads if str(count) != wanted_threads]
    return faults


def chosen_by(commit: str) -> str:
    """Return the name of the setting that a commit's hash chooses: over many commits each is chosen as often."""
    return list(SETTINGS)[int(commit, 16) % len(SETTINGS)]


def run_under(name: str, command: list[str]) -> int:
    """Run the command under a setting and with an empty compile cache; return its exit status."""
    if name not in SETTINGS:
        print(f"error: no setting {name!r} on this machine\nhint: {', '.join(SETTINGS)}", file=sys.stderr)
        return 2
    setting = SETTINGS[name]
    said = " ".join(
        f"{key}={value!r}" if " " in value else f"{key}={value}" for key, value in setting.items()
    )
    print(f"setting {name}: {said}", flush=True)
    faults = faults_of(setting)
    if faults:
        print(f"error: setting {name} has no effect: {'; '.join(faults)}", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory(prefix="psdmc-machine-") as folder:
        own = setting | {"PSDMC_CACHE_DIR": str(Path(folder) / "cache")}
        return subprocess.run(command, env=os.environ | own, check=False).returncode


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["names"]:
            print("\n".join(SETTINGS))
        case ["chosen-by", commit]:
            print(chosen_by(commit))
        case ["run", name, *command] if command:
            sys.exit(run_under(name, command))
        case _:
            sys.exit(str(__doc__))
