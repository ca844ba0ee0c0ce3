"""An emitted package in a colcon workspace: built, tested by its self-test, installed, and found by another package."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

import psdmc

ROBOT = Path(__file__).resolve().parents[2] / "examples" / "robots" / "two_link_full.toml"
BESIDE = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
COLCON = shutil.which("colcon", path=BESIDE)

PACKAGE = """<?xml version="1.0"?>
<package format="3"><name>controller</name><version>0.1.0</version><description>consumer</description>
<maintainer email="a@example.invalid">a</maintainer><license>0BSD</license>
<depend>panda_tcp</depend><export><build_type>cmake</build_type></export></package>
"""
CMAKE = """cmake_minimum_required(VERSION 3.13)
project(controller LANGUAGES C)
find_package(panda_tcp REQUIRED)
add_executable(controller main.c)
target_link_libraries(controller PRIVATE panda_tcp::panda_tcp)
install(TARGETS controller DESTINATION bin)
"""
MAIN = """#include <panda_tcp/panda_tcp.h>
#include <stdio.h>
int main(void)
{
    double q[panda_tcp_DOF] = {0}, tau[panda_tcp_DOF];
    panda_tcp_gravity(q, tau);
    return printf("%d %.17g\\n", panda_tcp_DOF, tau[0]) < 0;
}
"""


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    model = psdmc.derive(ROBOT)
    psdmc.emit_c(model, tmp_path / "src" / "arm", functions=["gravity"], name="panda-tcp")
    controller = tmp_path / "src" / "controller"
    controller.mkdir()
    for name, text in (("package.xml", PACKAGE), ("CMakeLists.txt", CMAKE), ("main.c", MAIN)):
        (controller / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_package_xml_names_the_package_as_cmake_does(workspace: Path) -> None:
    root = ElementTree.parse(workspace / "src" / "arm" / "package.xml").getroot()

    assert (root.tag, root.get("format"), root.findtext("name")) == ("package", "3", "panda_tcp")
    assert root.findtext("export/build_type") == "cmake"
    assert root.findtext("license") == "0BSD"
    assert "project(panda_tcp VERSION " + str(root.findtext("version")) in (
        workspace / "src" / "arm" / "CMakeLists.txt"
    ).read_text(encoding="utf-8")


@pytest.mark.skipif(
    COLCON is None or not shutil.which("cmake"), reason="no colcon (pip install colcon-ros ...), or no CMake"
)
def test_the_folder_drops_into_a_colcon_workspace(workspace: Path) -> None:
    def colcon(*words: str) -> str:
        done = subprocess.run(
            [str(COLCON), *words], cwd=workspace, capture_output=True, text=True, check=False,
            env=os.environ | {"PATH": BESIDE},
        )  # fmt: skip
        assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        return done.stdout

    built = colcon("build")
    colcon("test")
    results = colcon("test-result", "--all")
    done = subprocess.run(
        [workspace / "install" / "controller" / "bin" / "controller"],
        capture_output=True,
        text=True,
        check=True,
    )

    assert built.index("Finished <<< panda_tcp") < built.index("Finished <<< controller")
    assert "Summary: 1 test, 0 errors, 0 failures, 0 skipped" in results
    dof, gravity = done.stdout.split()
    expected = psdmc.derive(ROBOT).gravity([0.0, 0.0])
    assert (int(dof), float(gravity)) == (2, pytest.approx(expected[0], rel=1e-12))
