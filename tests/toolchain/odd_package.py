"""A package of one function with all kinds of inputs and outputs, which can fail: its kernels, traced by hand."""

from __future__ import annotations

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, JointInfo, PackageInfo
from psdmc.backends.reference_states import ReferenceStates
from psdmc.model.equations import BaseParameter
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Q, Quantity, Signature, Structure, SymmetricMatrix
from psdmc.program.trace import Slot, Tracer

N, L, FRAMES = 3, 2, 2
PIVOT = SymmetricMatrix("the odd one", Structure.DENSE, ("nv",), "the joint that is odd", "one joint is odd")
FUNCTION = Signature(
    "everything",
    1000,
    "all kinds of outputs",
    (Q, Quantity("load", ("frames", "6"))),
    (
        Quantity("energy"),
        Quantity("slope", ("nv",)),
        Quantity("turn", ("frames", "3", "3")),
        Quantity("M", ("nv", "nv")),
    ),
    theta=True,
    factorises=(PIVOT,),
    spoilt="outputs",
)
INFO = PackageInfo(
    name="odd",
    joints=tuple(JointInfo(f"j{i}", "revolute") for i in range(N)),
    gravity=(0.0, 0.0, -9.81),
    base="wall",
    tip="bob",
    parameters=tuple(BaseParameter(f"p{i}", "kg", 1.0 + i) for i in range(L)),
    model_hash="",
    psdmc_version="0.1.0",
    frames=("camera", 'bo"b'),
)


def everything(theta: bool) -> Kernel:
    """Products of what is given; one entry of each vector is left zero. The pivots are 1 + cos q."""
    tracer = Tracer()
    q, load = tracer.symbols("q", N), tracer.symbols("load", 6 * FRAMES)
    p = tracer.symbols("theta_b", L) if theta else [1.0, 2.0]
    pairs = [value.sincos() for value in q]
    outputs = [(Slot("energy", 0), pairs[0][0] * p[0] + load[11])]
    outputs += [(Slot("slope", i), pairs[i][0] * load[i] + p[1]) for i in range(N - 1)]
    outputs += [(Slot("turn", i), pairs[i % N][i % 2] * load[i % 12]) for i in range(9 * FRAMES) if i != 4]
    outputs += [(Slot("M", i), pairs[i // N][0] * pairs[i % N][1] + p[0]) for i in range(N * N)]
    outputs += [(Slot("pivot", i), pairs[i][1] + 1.0) for i in reversed(range(N))]
    program = tracer.finish(outputs)
    return Kernel(FUNCTION, theta, program, program, "factored")


KERNELS = {kernel.name: kernel for kernel in map(everything, (False, True))}


def odd_package(
    real: str = "float64", references: ReferenceStates | None = None, trig: str = "inline"
) -> PackageView:
    return package_view(INFO, KERNELS, EmitOptions(real, trig), references)  # type: ignore[arg-type]
