"""Time a Rust crate beside the C package of the same model, one state a call: python beside_rust.py MODEL.npz ...

Both are compiled for this machine. Each figure is the smallest mean over 64 states of 200 measurements, in nanoseconds.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import psdmc
from psdmc.compiler import emit

STATES, TIMES = 64, 200
C_FLAGS = ["-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"]
C_FLAGS += ["-fno-tree-slp-vectorize"]
"""Those of the package's own build files."""

RUST = """
use std::time::Instant;

/// Makes the compiler forget what it knows about a value.
#[inline(always)]
fn opaque<T>(x: T) -> T {
    unsafe { std::arch::asm!("/* {0} */", in(reg) &x, options(nostack)) }
    x
}

fn states<const N: usize>(mut seed: u64) -> Vec<[f64; N]> {
    (0..STATES).map(|_| [0.0; N].map(|_| { seed = next(seed); real(seed) })).collect()
}

fn next(seed: u64) -> u64 {
    seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407)
}

fn real(seed: u64) -> f64 {
    (seed >> 33) as f64 / (1u64 << 30) as f64 - 1.0
}

fn time(name: &str, mut call: impl FnMut(usize)) {
    let mut best = f64::MAX;
    for _ in 0..TIMES {
        let start = Instant::now();
        (0..STATES).for_each(&mut call);
        best = best.min(start.elapsed().as_nanos() as f64 / STATES as f64);
    }
    println!("{name} {best}");
}
"""

C = """
#include <stdint.h>
#include <stdio.h>
#include <time.h>

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * t.tv_sec + t.tv_nsec;
}

static void fill(double *a, int n, uint64_t seed)
{
    for (int i = 0; i < STATES * n; i++) {
        seed = seed * 6364136223846793005ull + 1442695040888963407ull;
        a[i] = (double)(seed >> 33) / (1 << 30) - 1.0;
    }
}

#define TIME(name, call) do { \\
    double best = 1e30; \\
    for (int i = 0; i < TIMES; i++) { \\
        const double start = now(); \\
        for (int k = 0; k < STATES; k++) { call; __asm__ volatile("" ::: "memory"); } \\
        const double each = (now() - start) / STATES; \\
        best = each < best ? each : best; \\
    } \\
    printf(name " %f\\n", best); \\
} while (0)

static double out[4][16384];
"""


def main() -> None:
    for path in sys.argv[1:]:
        model = psdmc.load(path)
        with tempfile.TemporaryDirectory() as folder:
            psdmc.emit_c(model, Path(folder) / "c", name="robot")
            emit(model, Path(folder) / "rust", "rust", name="robot")
            found = measured(Path(folder), {"q": model.nq, "qd": model.nv, "qdd": model.nv, "tau": model.nv})
        for name, (c, rust) in found.items():
            print(f"{Path(path).stem} {name:24} C {c:7.1f}  Rust {rust:7.1f}  {rust / c:.2f}")


def measured(folder: Path, sizes: dict[str, int]) -> dict[str, tuple[float, float]]:
    """ns by function, of those that read nothing else than these vectors: in C, in Rust."""
    calls = {}
    for source in sorted((folder / "rust" / "src").glob("*.rs")):
        head = re.search(r"pub fn (\w+)\((.*?)\)", source.read_text())
        if head and all(
            word.startswith(tuple(f"{name}: &" for name in sizes)) for word in head[2].split(", ")
        ):
            calls[head[1]] = [word.partition(":")[0] for word in head[2].split(", ")]
    c, rust = (write(folder, calls, sizes) for write in (in_c, in_rust))
    return {name: (c[name], rust[name]) for name in calls}


def in_rust(folder: Path, calls: dict[str, list[str]], sizes: dict[str, int]) -> dict[str, float]:
    """The crate's times."""
    lines = [f"let {name} = states::<{size}>({k});" for k, (name, size) in enumerate(sizes.items(), 1)]
    for name, inputs in calls.items():
        words = ", ".join(f"opaque(&{each}[k])" for each in inputs)
        lines.append(f'time("{name}", |k| {{ let _ = opaque(robot::{name}({words})); }});')
    consts = f"const STATES: usize = {STATES};\nconst TIMES: usize = {TIMES};\n"
    (folder / "main.rs").write_text(f"{consts}{RUST}\nfn main() {{ {' '.join(lines)} }}\n")
    (folder / "Cargo.toml").write_text(
        '[package]\nname = "time"\nversion = "0.1.0"\nedition = "2021"\n'
        '[dependencies]\nrobot = { path = "rust" }\n[[bin]]\nname = "time"\npath = "main.rs"\n'
    )
    environment = os.environ | {"RUSTFLAGS": "-C target-cpu=native"}
    subprocess.run(
        ["cargo", "build", "--release", "--quiet", "--offline"], cwd=folder, env=environment, check=True
    )
    return said([folder / "target" / "release" / "time"])


def in_c(folder: Path, calls: dict[str, list[str]], sizes: dict[str, int]) -> dict[str, float]:
    """The package's times."""
    lines = [f"static double {name}[STATES * {size}];" for name, size in sizes.items()]
    lines += ["int main(void) {"]
    lines += [f"fill({name}, {size}, {k});" for k, (name, size) in enumerate(sizes.items(), 1)]
    for name, inputs in calls.items():
        words = ", ".join([*(f"{each} + k * {sizes[each]}" for each in inputs), *outputs(folder, name)])
        lines.append(f'TIME("{name}", robot_{name}({words}));')
    head = f'#define STATES {STATES}\n#define TIMES {TIMES}\n#include "robot/robot.h"\n'
    (folder / "main.c").write_text(head + C + "\n".join([*lines, "return 0; }"]) + "\n")
    sources = [str(path) for path in (folder / "c" / "src").glob("*.c")]
    command = ["cc", *C_FLAGS, "-Ic/include", "main.c", *sources, "-lm", "-o", "in_c"]
    subprocess.run(command, cwd=folder, check=True)
    return said([folder / "in_c"])


def outputs(folder: Path, name: str) -> list[str]:
    """Places for what a C function writes."""
    header = (folder / "c" / "include" / "robot" / "robot.h").read_text()
    words = re.search(rf"\brobot_{name}\((.*?)\);", header)
    assert words
    return [
        f"out[{k}]" for k in range(len([word for word in words[1].split(", ") if word.startswith("double")]))
    ]


def said(command: list[Path]) -> dict[str, float]:
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {name: float(value) for name, value in (line.split() for line in done.stdout.splitlines())}


if __name__ == "__main__":
    main()
