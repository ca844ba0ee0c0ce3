"""The back end that writes C packages."""

from __future__ import annotations

from dataclasses import replace

from psdmc.backends.c.adapters import with_own_kernels
from psdmc.backends.c.estimator import estimator_view
from psdmc.backends.c.package import package_view
from psdmc.backends.c.package_files import package_files
from psdmc.backends.c.render import identifier
from psdmc.backends.protocol import BackEnd, Emission


def _files(given: Emission) -> dict[str, str]:
    package = package_view(given.info, given.kernels, given.options, given.references, given.adapters)
    if given.estimator is not None:
        view = estimator_view(given.estimator, given.info, package.robot, package.alone.options)
        package = replace(package, estimator=view)
    return package_files(with_own_kernels(package, given.kernels))


def _entry(robot: str) -> tuple[str, str]:
    return f"include/{robot}/{robot}.h", f"the header, #include <{robot}/{robot}.h>"


BACK_END = BackEnd(
    "C", "prefix of C names", _files, identifier, _entry, lambda folder: f"psdmc build {folder}"
)
