"""The table `[elasticity]`: joints whose stiffness is asked for, and drive inertias that are known."""

from __future__ import annotations

from dataclasses import replace

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.table_joints import require_joints
from psdmc.calibration.identify.linear_options import ElasticityOptions, LinearOptions
from psdmc.calibration.logs.toml_tables import TomlTable, shown

LARGEST_INERTIA = 1e6
"""kg m^2 (kg), at the joint."""


def _read(value: object, reading: Reading) -> ElasticityOptions:
    table = TomlTable(value, "elasticity", ("joints", "drive_inertia"), reading.faults)
    names = table.items("joints") if table.has("joints") else []
    odd = [shown(name) for name in names if not isinstance(name, str)]
    if odd:
        reading.faults.append(f"elasticity: joints: found {', '.join(odd)}, expected names of joints")
        return ElasticityOptions(True)
    given = table.content.get("drive_inertia", {})
    inner = TomlTable(
        given, "elasticity: drive_inertia", tuple(given) if isinstance(given, dict) else (), reading.faults
    )
    inertias = {name: inner.number(name, 0.0, LARGEST_INERTIA) for name in inner.content}
    require_joints([*(str(name) for name in names), *inertias], "elasticity", reading)
    return ElasticityOptions(True, tuple(str(name) for name in names), inertias)


def _options(options: LinearOptions, value: ElasticityOptions) -> LinearOptions:
    return replace(options, elasticity=value)


ELASTICITY: Table[ElasticityOptions] = Table("elasticity", _read, ElasticityOptions(), _options)
