"""What an MJCF repeats, attaches and makes: refused before MuJoCo spends hours on it, or dies."""

from __future__ import annotations

from pathlib import Path

import pytest

from psdmc.errors import InputError
from psdmc.robot.load import load_robot
from psdmc.robot.mjcf.copies import refuse_many_copies

pytest.importorskip("mujoco")


def model(inside: str, assets: str = "") -> str:
    body = f'<body name="x"><joint name="j"/><geom size=".1" pos=".1 0 0"/>{inside}</body>'
    return f"<mujoco><asset>{assets}</asset><worldbody>{body}</worldbody></mujoco>"


def attached(file: str, times: int = 1) -> str:
    copies = "".join(f'<attach model="m" body="x" prefix="p{k}"/>' for k in range(times))
    return model(copies, f'<model name="m" file="{file}"/>')


def written(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return folder / "robot.xml"


@pytest.mark.parametrize(
    "files",
    [
        {"robot.xml": attached("robot.xml")},
        {"robot.xml": attached("other.xml"), "other.xml": attached("./robot.xml")},
        {"robot.xml": model("", '<model file="other.xml"/>'), "other.xml": model("", '<model file="other.xml"/>')},
    ],
)  # fmt: skip
def test_a_model_that_is_a_part_of_itself_is_refused(files: dict[str, str], tmp_path: Path) -> None:
    """MuJoCo calls itself until the process dies."""
    with pytest.raises(InputError, match=r"robot.xml: '\w+.xml' attaches itself") as refused:
        load_robot(written(tmp_path, files))
    assert refused.value.hint


def test_models_that_double_by_attaching_are_counted(tmp_path: Path) -> None:
    files = {f"m{k}.xml": attached(f"m{k + 1}.xml", 2) for k in range(15)}
    files |= {"robot.xml": attached("m0.xml", 2), "m15.xml": model("")}
    with pytest.raises(InputError, match=r"<attach> ask for \d{5,} elements, expected 3000 at most"):
        load_robot(written(tmp_path, files))


@pytest.mark.parametrize(
    "files",
    [
        {"robot.xml": model('<replicate count="800" offset=".1 0 0"><attach model="m" body="x" prefix="p"/></replicate>',
                            '<model name="m" file="part.xml"/>'), "part.xml": model("")},
        {"robot.xml": attached("d/part.xml"), "d/part.xml": model('<include file="more.xml"/>'),
         "d/more.xml": '<mujocoinclude><replicate count="4000"><geom size="1"/></replicate></mujocoinclude>'},
        {"robot.xml": model('<include file="d/part.xml"/>'), "d/part.xml": '<x><include file="more.xml"/></x>',
         "d/more.xml": '<x><replicate count="4000"><geom size="1"/></replicate></x>'},
    ],
)  # fmt: skip
def test_copies_of_what_is_attached_are_counted(files: dict[str, str], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ask for \d{4} elements, expected 3000 at most"):
        refuse_many_copies(written(tmp_path, files), "robot.xml")


def test_what_is_deep_is_refused(tmp_path: Path) -> None:
    """Python's own recursion ends at a thousand."""
    deep = model("<body>" * 3000 + "</body>" * 3000)
    with pytest.raises(InputError, match="elements within each other 3003 deep, expected 300 at most"):
        load_robot(written(tmp_path, {"robot.xml": deep}))
    files = {f"m{k}.xml": attached(f"m{k + 1}.xml") for k in range(30)}
    files |= {"robot.xml": attached("m0.xml"), "m30.xml": model("")}
    with pytest.raises(InputError, match="models attach models more than 20 deep"):
        load_robot(written(tmp_path, files))


def test_numbers_of_copies_are_written_out(tmp_path: Path) -> None:
    text = model('<replicate count="3000000"><geom size="1"/></replicate>')
    with pytest.raises(InputError, match="ask for 3000000 elements"):
        load_robot(written(tmp_path, {"robot.xml": text}))


def test_what_is_attached_is_part_of_the_robot(tmp_path: Path) -> None:
    """Once, twice, as one body of a long file, and by the model's own name."""
    long = model("").replace("</worldbody>", "<geom size='1'/>" * 4000 + "</worldbody>")
    for count in (1, 2):
        files = {"robot.xml": attached("d/long.xml", count), "d/long.xml": long}
        assert len(load_robot(written(tmp_path, files)).mechanism.joints) == 1 + count
    own = model("").replace("<mujoco>", '<mujoco model="m">')
    text = attached("own.xml").replace('name="m" file', "file")
    assert len(load_robot(written(tmp_path, {"robot.xml": text, "own.xml": own})).mechanism.joints) == 2


@pytest.mark.parametrize(
    ("asset", "said"),
    [
        ('<mesh name="m" builtin="supersphere" params="3000 1 1"/>', "mesh 'm' asks for 9e+06 points"),
        ('<mesh name="m" builtin="cone" params="20000 1"/>', "mesh 'm' asks for 2e+04 points, expected 1000"),
        ('<mesh name="m" builtin="plate" params="3000 3000"/>', "mesh 'm' asks for 9e+06 points"),
        ('<hfield name="h" nrow="40000" ncol="40000" size="1 1 1 1"/>', "height field 'h' asks for 1.6e+09 cells"),
        ('<texture name="t" type="2d" builtin="flat" width="50000" height="50000"/>', "texture 't' asks for 2.5e+09"),
        ('</asset><size nkey="1000000000"/><asset>', "<size nkey> asks for 1e+09 numbers, expected 1000000 at most"),
    ],
)  # fmt: skip
def test_what_takes_minutes_or_gigabytes_is_refused(asset: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        load_robot(written(tmp_path, {"robot.xml": model("", asset)}))
    assert said in refused.value.message


def test_meshes_that_mujoco_makes_are_read(tmp_path: Path) -> None:
    mesh = '<mesh name="m" builtin="supersphere" params="20 1 1"/>'
    text = model('<geom type="mesh" mesh="m"/>', mesh)
    assert load_robot(written(tmp_path, {"robot.xml": text})).mechanism.joints
