"""An emitted package from Python, without psdmc: `with_cffi.py PACKAGE` after `make -C PACKAGE`.

manifest.json holds all that cffi needs to know: the C prototypes, the robot's name and its number of joints.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cffi
import numpy as np


def main(package: Path) -> None:
    manifest = json.loads((package / "manifest.json").read_text(encoding="utf-8"))
    robot, real = manifest["robot"], manifest["real"]
    prototypes = [p for f in manifest["functions"] for kernel in f["kernels"] for p in kernel["prototypes"]]

    ffi = cffi.FFI()
    ffi.cdef("".join(f"{prototype};\n" for prototype in prototypes))
    library = ffi.dlopen(str(package / "build" / f"lib{robot}.so"))

    def pointer(array: np.ndarray) -> object:
        return ffi.from_buffer(f"{real} *", array)

    n, count = len(manifest["joints"]), 1000
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, count, n)).astype(real)
    tau, back = np.empty_like(q), np.empty_like(q)
    inputs = list(map(pointer, (q, qd, qdd)))
    getattr(library, f"{robot}_inverse_dynamics_batch")(count, *inputs, pointer(tau))
    failed = getattr(library, f"{robot}_forward_dynamics_batch")(
        count, inputs[0], inputs[1], pointer(tau), pointer(back)
    )

    names = ", ".join(joint["name"] for joint in manifest["joints"])
    print(
        json.dumps(
            {
                "joints": names,
                "failed": failed,
                "error": float(np.abs(back - qdd).max()),
                "tau": tau[0].tolist(),
            }
        )
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
