"""The stress program of one package: stress.h, and the package's functions as it wants to call them."""

from __future__ import annotations

from pathlib import Path

from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.package import PackageView

RUNTIME = tuple(Path(__file__).with_name(name) for name in ("stress.h", "stress_threads.h"))


def stress_program(package: PackageView) -> str:
    """C text of the program that calls all of the package's functions in all layouts, whatever their signatures."""
    own = f"{package.robot}_theta_b"
    known = all(parameter.value is not None for parameter in package.info.parameters)
    widest = max(vector.size for kernel in package.kernels for vector in kernel.inputs)
    lines = [
        f'#include "{package.robot}/{package.robot}.h"',
        f"typedef {package.real} real;",
        f"#define L {package.l}",
        f"#define LANES {package.lanes}",
        f"#define VECTORS {max(len(kernel.inputs) for kernel in package.kernels)}",
        f"#define OUTPUTS {package.self_test.most_outputs}",
        f"#define WIDEST {widest}",
        f"#define MOST {max(package.self_test.largest_output, widest, package.l)}",
    ]
    for kernel in package.kernels:
        lines += _wrappers(kernel)
    entries = ", ".join(_entry(kernel) for kernel in package.kernels)
    lines += [f"#define KERNELS {entries}", '#include "stress.h"']
    theta = own if known else "ones"
    ones = "" if known else f"static const real ones[L] = {{{', '.join(['1'] * package.l)}}};"
    lines += [ones, f"int main(void) {{ return stress_main({theta}); }}"]
    return "\n".join(lines) + "\n"


def _wrappers(kernel: KernelView) -> list[str]:
    """Each form with the signature that stress.h's table has."""
    inputs = [f"in[{k}]" for k in range(len(kernel.inputs))] + (["theta"] if kernel.theta else [])
    outputs = [f"out[{k}]" for k in range(len(kernel.outputs))]
    ignored = "" if kernel.theta else "(void)theta; "
    made = []
    for form, prototype in kernel.prototypes.items():
        many = form != "single"
        arguments = ", ".join([*(["count"] if many else []), *inputs, *outputs])
        call = f"{prototype.symbol}({arguments})"
        body = f"{call}; return 0;" if prototype.returns == "void" else f"return (size_t){call};"
        count = "size_t count, " if many else ""
        made.append(
            f"static size_t call_{kernel.name}_{form}({count}const real *const *in, const real *theta, real *const *out)"
            f" {{ {ignored}{body} }}"
        )
    return made


def _entry(kernel: KernelView) -> str:
    lanes = f"call_{kernel.name}_batch_soa" if "batch_soa" in kernel.prototypes else "0"
    inputs, outputs = ([str(vector.size) for vector in side] for side in (kernel.inputs, kernel.outputs))
    fields = [
        f'"{kernel.name}"',
        *(str(len(inputs)), "{" + ", ".join(inputs) + "}"),
        *(str(len(outputs)), "{" + ", ".join(outputs) + "}"),
        str(sum(map(int, outputs))),
        str(int(kernel.theta)),
    ]
    return "{" + ", ".join([*fields, f"call_{kernel.name}_single", f"call_{kernel.name}_batch", lanes]) + "}"
