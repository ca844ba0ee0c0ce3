"""Kernels (operations) of packed matrices, that is, of vectors with the entries of a matrix that can differ from zero.
They are parts of the kernels of whole matrices."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from psdmc.dynamics.structure import Places
from psdmc.program.kernel import Kernel
from psdmc.program.limb_program import LimbGroup, LimbProgram, Stage
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Program, Slot
from psdmc.program.regions import Column, Reader, Regions, drop_unread, straight
from psdmc.program.signature import Signature

Kept = Mapping[Slot, Slot]
"""Where each entry that is kept goes."""


def packed(kernel: Kernel, function: Signature, columns: int, places: Places) -> Kernel:
    """Return the kernel (operations) of `function`, whose only output is a vector of matrix entries. It is the kernel
    of the whole matrix, without operations that these entries do not need.

    columns  number of columns of the matrix
    places   (row, column) of each entry
    """
    (matrix,), (values,) = kernel.function.outputs, function.outputs
    kept = {
        Slot(matrix.name, row * columns + column): Slot(values.name, k)
        for k, (row, column) in enumerate(places)
    }
    single = _only(kernel.single, matrix.name, kept)
    batch = single if kernel.batch is kernel.single else _only(kernel.batch, matrix.name, kept)
    limbs = None if kernel.limbs is None else _limbs(kernel.limbs, matrix.name, kept)
    regions = None if kernel.regions is None else _regions(kernel.regions, matrix.name, columns, kept)
    return replace(
        kernel, function=function, single=single, batch=batch, limbs=limbs, places=places, regions=regions
    )


def _only(program: Program, matrix: str, kept: Kept) -> Program:
    """The PROGRAM without the matrix's other entries; pivots stay."""
    outputs = tuple(
        (kept.get(slot, slot), index)
        for slot, index in program.outputs
        if slot in kept or slot.vector != matrix
    )
    return drop_unused(Program(program.body, outputs))


def _regions(body: Regions, matrix: str, columns: int, kept: Kept) -> Regions:
    """The regions, which compute the whole matrix in an array of their own, and copies of the entries that are kept."""

    def copied(read: Reader) -> dict[str, Column]:
        (name,) = {place.vector for place in kept.values()}
        return {name: Column([read(matrix, 1, first=slot.index)[0] for slot in kept])}

    arrays = {**body.arrays, matrix: columns * columns}
    return drop_unread(replace(body, arrays=arrays, regions=(*body.regions, straight(copied))))


def _limbs(limbs: LimbProgram, matrix: str, kept: Kept) -> LimbProgram | None:
    """None where an entry is kept of some limbs of a group and left out of others."""
    groups = []
    for group in limbs.groups:
        outputs = []
        for slot, own in group.outputs:
            found = [kept[each] for each in own if each in kept]
            if len(found) not in (0, len(own)):
                return None
            if found:
                outputs.append((slot, tuple(found)))
        groups.append(replace(group, outputs=tuple(outputs)))
    stages = _stages(limbs.stages, groups, matrix, kept)
    return replace(limbs, groups=tuple(groups), stages=stages)


def _stages(
    stages: Iterable[Stage], groups: Iterable[LimbGroup], matrix: str, kept: Kept
) -> tuple[Stage, ...]:
    """The stages without the outputs that nothing puts out; what led to these alone is dropped within each stage."""
    wanted = {group.output: {slot for slot, _ in group.outputs} for group in groups}
    found = []
    for stage in stages:
        outputs = []
        for slot, index in stage.program.outputs:
            if slot.vector == matrix:
                if slot in kept:
                    outputs.append((kept[slot], index))
            elif slot.vector not in wanted or slot in wanted[slot.vector]:
                outputs.append((slot, index))
        found.append(replace(stage, program=drop_unused(Program(stage.program.body, tuple(outputs)))))
    return tuple(found)
