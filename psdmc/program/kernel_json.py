"""Conversion of kernels (the operations of generated functions) to JSON and back, for a cache on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from psdmc.errors import InternalError
from psdmc.program.kernel import Kernel
from psdmc.program.limb_program import LimbGroup, LimbProgram, Spread, Stage
from psdmc.program.operations import BY_WORD
from psdmc.program.products import Shares, ThinProducts
from psdmc.program.program import Instr, Op, Program, Slot, check
from psdmc.program.regions import Call, For, Region, Regions, Slice, Straight
from psdmc.program.signature import Signature

FORMAT = 6
"""Version of the text's form."""


def kernels_to_json(kernels: Mapping[str, Kernel]) -> str:
    """Return the JSON text of kernels in their order. Constants can be read back bit for bit."""
    # One kernel at a time: lists of all of a large robot's instructions together take more memory than its kernels.
    plain = map(_kernel_to_plain, kernels.values())
    entries = ",".join(json.dumps(each, separators=(",", ":"), allow_nan=False) for each in plain)
    return f'{{"format":{FORMAT},"kernels":[{entries}]}}'


def _kernel_to_plain(kernel: Kernel) -> dict[str, Any]:
    return {
        "function": kernel.function.name,
        "theta": kernel.theta,
        "lowering": kernel.lowering,
        "single": _program_to_plain(kernel.single),
        "batch": None if kernel.batch is kernel.single else _program_to_plain(kernel.batch),
        "before": None if kernel.before is None else _program_to_plain(kernel.before),
        "limbs": None if kernel.limbs is None else _limbs_to_plain(kernel.limbs),
        "places": kernel.places,
        "regions": None if kernel.regions is None else _regions_to_plain(kernel.regions),
    }


def kernels_from_json(text: str, functions: Mapping[str, Signature]) -> dict[str, Kernel]:
    """Return the kernels in a JSON text by name, in their order in the text. Raises InternalError if `kernels_to_json`
    did not write the text.

    functions  signatures by name, among which each kernel's function must be
    """
    try:
        whole = json.loads(text)
        if whole["format"] != FORMAT:
            raise ValueError(f"format {whole['format']}, expected {FORMAT}")
        kernels = [_kernel_from_plain(entry, functions) for entry in whole["kernels"]]
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise InternalError(f"kept kernels cannot be read: {error}") from error
    return {kernel.name: kernel for kernel in kernels}


def _kernel_from_plain(entry: Mapping[str, Any], functions: Mapping[str, Signature]) -> Kernel:
    single = _program_from_plain(entry["single"])
    batch = single if entry["batch"] is None else _program_from_plain(entry["batch"])
    before = None if entry["before"] is None else _program_from_plain(entry["before"])
    limbs = None if entry["limbs"] is None else _limbs_from_plain(entry["limbs"])
    places = tuple((row, column) for row, column in entry["places"])
    function, theta, lowering = functions[entry["function"]], entry["theta"], entry["lowering"]
    regions = None if entry["regions"] is None else _regions_from_plain(entry["regions"])
    return Kernel(function, theta, single, batch, lowering, before, limbs, places, regions)


def _regions_to_plain(body: Regions) -> dict[str, Any]:
    return {
        "arrays": dict(body.arrays),
        "constants": dict(body.constants),
        "regions": list(map(_region_to_plain, body.regions)),
    }


def _region_to_plain(region: Region) -> dict[str, Any]:
    if isinstance(region, Straight):
        return {"straight": _program_to_plain(region.program)}
    if isinstance(region, Call):
        return {
            "call": region.function,
            "given": region.given,
            "found": region.found,
            "pivots": region.pivots,
            "again": region.again,
        }
    slices = [[each.name, each.array, each.first, each.stride] for each in region.slices]
    return {"count": region.count, "slices": slices, "regions": list(map(_region_to_plain, region.regions))}


def _regions_from_plain(plain: Any) -> Regions:
    constants = {name: tuple(map(float, values)) for name, values in plain["constants"].items()}
    return Regions(plain["arrays"], tuple(map(_region_from_plain, plain["regions"])), constants)


def _region_from_plain(plain: Any) -> Region:
    if "straight" in plain:
        return Straight(_program_from_plain(plain["straight"]))
    if "call" in plain:
        given, found = (tuple((name, first) for name, first in plain[key]) for key in ("given", "found"))
        return Call(plain["call"], given, found, plain["pivots"], plain["again"])
    slices = tuple(Slice(*each) for each in plain["slices"])
    return For(plain["count"], slices, tuple(map(_region_from_plain, plain["regions"])))


def _limbs_to_plain(limbs: LimbProgram) -> dict[str, Any]:
    groups = [
        [group.number, group.count, group.inputs, group.constants, group.outputs] for group in limbs.groups
    ]
    stages = [[stage.group, _program_to_plain(stage.program)] for stage in limbs.stages]
    products = list(map(asdict, limbs.products))
    return {
        "groups": groups,
        "stages": stages,
        "least": limbs.least,
        "products": products,
        "checked": limbs.checked,
    }


def _limbs_from_plain(plain: Mapping[str, Any]) -> LimbProgram:
    groups = tuple(
        LimbGroup(
            number,
            count,
            _spread(inputs),
            tuple(tuple(map(float, row)) for row in constants),
            _spread(outputs),
        )
        for number, count, inputs, constants, outputs in plain["groups"]
    )
    stages = tuple(Stage(group, _program_from_plain(program)) for group, program in plain["stages"])
    return LimbProgram(
        groups, stages, plain["least"], tuple(map(_products_from_plain, plain["products"])), plain["checked"]
    )


def _products_from_plain(plain: Mapping[str, Any]) -> ThinProducts:
    groups = tuple(
        Shares(each["vector"], tuple(each["rows"]), tuple(each["carriers"]), each["is_below"])
        for each in plain["groups"]
    )
    outputs, known, core, below = (tuple(plain[name]) for name in ("outputs", "known", "core", "below"))
    return ThinProducts(outputs, known, plain["n"], core, groups, below, plain["is_solved"])


def _spread(plain: Any) -> tuple[Spread, ...]:
    return tuple((Slot(*slot), tuple(Slot(*each) for each in own)) for slot, own in plain)


def _program_to_plain(program: Program) -> list[Any]:
    """[[operation, its arguments ...] ...], with vector and index for loads and the value for constants; outputs."""
    body: list[list[Any]] = []
    for op, args, slot, value in program.body:
        body.append([op, *args] if args else [op, *slot] if slot else [op, value])
    return [body, [[*slot, index] for slot, index in program.outputs]]


def _program_from_plain(plain: Any) -> Program:
    body, outputs = plain
    slots: dict[tuple[str, int], Slot] = {}

    def slot_of(vector: str, index: int) -> Slot:
        return slots.setdefault((vector, index), Slot(vector, index))

    def instruction(word: str, *rest: Any) -> Instr:
        op = BY_WORD[word]
        if op is Op.LOAD:
            return Instr(op, slot=slot_of(*rest))
        return Instr(op, value=float(rest[0])) if op is Op.CONST else Instr(op, rest)

    stored = tuple((slot_of(vector, index), value) for vector, index, value in outputs)
    return check(Program(tuple(instruction(*entry) for entry in body), stored), after="reading kept kernels")
