"""Each message of the troubleshooting page is printed by the command that provokes it, and the page is of the table."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from blocks import ROOT
from command_line import typed

import psdmc

sys.path.insert(0, str(ROOT / "docs"))
import troubleshooting
from troubleshooting import ARRAYS, GROUPS, Entry

ARM = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
<inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore">{inertial}</link>
<joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/>
<axis xyz="0 1 0"/></joint></robot>"""
INERTIAL = """<inertial><origin xyz="0.15 0 0"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial>"""

BODY = """<robot name="arm"><link name="base"/><link name="fore"><inertial><mass value="2"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="elbow" type="continuous"><parent link="base"/><child link="fore"/><axis xyz="0 1 0"/></joint></robot>"""

FILES = {
    "negative.urdf": BODY.replace('value="2"', 'value="-2"'),
    "comma.urdf": BODY.replace('value="2"', 'value="2,0"'),
    "unphysical.urdf": BODY.replace('iyy="0.02"', 'iyy="0.5"'),
    "screw.urdf": BODY.replace("continuous", "screw"),
    "child.urdf": BODY.replace('child link="fore"', 'child link="for"'),
    "mimic.urdf": BODY.replace("<axis", '<mimic joint="none"/><axis'),
    "empty.urdf": "",
    "broken.urdf": "<robot><link>",
    "other.urdf": "<html></html>",
    "world.sdf": '<sdf version="1.6"><world name="w"/></sdf>',
    "broken.toml": "joints = [",
    "arm.urdf": ARM.format(inertial=INERTIAL),
    "bare.urdf": ARM.format(inertial=""),
    "loop.toml": """[[loop]]
rows = 3
first = { link = "fore", xyz = [0.3, 0.0, 0.0] }
second = { link = "base", xyz = [0.5, 0.0, 0.0] }
""",
    "words.csv": "a,b\n1,2\n",
    "mine/notes.txt": "mine",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("troubles")
    (made / "examples").symlink_to(ROOT / "examples")
    for name, text in FILES.items():
        (made / name).parent.mkdir(exist_ok=True)
        (made / name).write_text(text, encoding="utf-8")
    for robot in ("arm", "bare"):
        assert typed("derive", f"{robot}.urdf", "-o", f"{robot}.npz", cwd=made).returncode == 0
    return made


COMMANDS = [entry for entries in GROUPS.values() if entries is not ARRAYS for entry in entries]


def says(message: str, entry: Entry) -> bool:
    return bool(re.search(re.escape(entry.part).replace("…", ".+"), message))


@pytest.mark.parametrize("entry", COMMANDS, ids=lambda entry: entry.typed)
def test_the_message_is_printed(entry: Entry, folder: Path):
    done = typed(*entry.typed.split(" "), cwd=folder)

    assert done.returncode == entry.status, done.stderr
    assert says(done.stdout + done.stderr, entry)


@pytest.mark.parametrize("entry", ARRAYS, ids=lambda entry: entry.typed)
def test_the_error_is_raised(entry: Entry, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    model = psdmc.derive("examples/robots/two_link.toml")
    scara = psdmc.derive("examples/robots/scara.toml", contacts=["link4:6"])
    names = {"np": np, "pd": pytest.importorskip("pandas"), "psdmc": psdmc, "model": model, "scara": scara}

    with pytest.raises(psdmc.InputError) as raised:
        eval(entry.typed, names | {"robot": psdmc.compile(model)})

    assert says(str(raised.value), entry)


def test_the_page_is_of_the_table():
    text = troubleshooting.PAGE.read_text(encoding="utf-8")

    assert text == troubleshooting.page(), "run python docs/troubleshooting.py"
