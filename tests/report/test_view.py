"""The page of `psdmc view`: bodies by closed form, motion by Pinocchio, names of files harmless, words before pictures."""

from __future__ import annotations

import json
import math
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import robot_path
from command_line import started, typed

from psdmc.derivation.derive import derive_model, provenance_of
from psdmc.errors import InputError
from psdmc.report.view import (
    FILE,
    MARK,
    MOST_POSES,
    NOT_PHYSICAL,
    body,
    embedded,
    page,
    require_own_page,
    scene,
    viewed,
    write_view,
)
from psdmc.robot.inertia import six_of, standard_parameters
from psdmc.robot.load import load_robot, load_robot_text
from psdmc.robot.mechanism import Placement
from psdmc.robot.placement import roll_pitch_yaw

ARM = robot_path("two_link").parent / "rounded_arm.urdf"

EVIL = "&lt;script&gt;alert('1')&lt;/script&gt;"


def urdf(inertia: str, mass: float = 2.0, name: str = "arm", tool: float = 0.3) -> str:
    """A joint that turns and one that slides, with a link fixed to the second."""
    solid = '<inertia ixx="0.002" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
    return f"""<robot name="{name}"><link name="base"/>
    <link name="{name}"><inertial><origin xyz="0.02 0 0.1" rpy="0.3 0.2 0.1"/><mass value="{mass}"/>{inertia}
    </inertial></link>
    <link name="slide"><inertial><origin xyz="0 0.01 0.1"/><mass value="1"/>{solid}</inertial></link>
    <link name="tool"><inertial><mass value="{tool}"/>{solid}</inertial></link>
    <joint name="turn" type="continuous"><origin xyz="0 0 0.2"/><parent link="base"/><child link="{name}"/>
      <axis xyz="0 1 0"/></joint>
    <joint name="push" type="prismatic"><origin xyz="0 0 0.4" rpy="0.1 0.2 0.3"/><parent link="{name}"/><child link="slide"/>
      <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>
    <joint name="fixed" type="fixed"><origin xyz="0 0 0.2" rpy="1 0 0"/><parent link="slide"/><child link="tool"/></joint>
    </robot>"""


SOLID = '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/>'


def moved(view: object, pose: int, point: list[float]) -> np.ndarray:
    """A scene's point [joint, x, y, z] in the base frame."""
    joint, *at = point
    if joint < 0:
        return np.array(at)
    own = view.poses[pose, int(joint)]
    return own[:9].reshape(3, 3) @ at + own[9:]


def test_the_ellipsoid_of_a_box_by_closed_form():
    """Moments of a box are m/12 (b^2 + c^2), so the solid ellipsoid has semi-axes sqrt(5/12) times its sides."""
    sides, mass, turn = np.array([0.1, 0.2, 0.4]), 3.0, roll_pitch_yaw((0.4, -0.7, 1.1))
    inertia = mass / 12.0 * np.diag((sides**2).sum() - sides**2)
    frame = Placement(roll_pitch_yaw((0.2, 0.5, -0.3)), np.array([0.1, 0.2, 0.3]))
    com = np.array([0.3, -0.1, 0.05])

    found = body("box", 0, frame, standard_parameters(mass, com, six_of(turn @ inertia @ turn.T)))

    half = math.sqrt(5.0 / 12.0) * sides
    np.testing.assert_allclose(found.half_axes, half, rtol=1e-12)
    axes = frame.rotation @ turn
    np.testing.assert_allclose(found.root, axes @ np.diag(half) @ axes.T, atol=1e-14)
    np.testing.assert_allclose(found.com, frame.translation + frame.rotation @ com, rtol=1e-14)
    assert found.density == pytest.approx(mass / (4.0 / 3.0 * math.pi * np.prod(half)))
    assert not found.fault


def test_a_point_mass_is_flat_and_no_fault():
    found = body("point", 0, Placement.identity(), standard_parameters(2.0, np.ones(3) / 3, np.zeros(6)))

    assert math.isnan(found.density)
    assert not found.fault
    assert not found.half_axes.any()


def written_log(folder: Path, robot: str | Path, rows: int = 400) -> tuple[Path, np.ndarray]:
    names = load_robot(robot).mechanism.joint_names if isinstance(robot, Path) else ("turn", "push")
    time = 0.01 * np.arange(rows)
    q = np.stack([0.4 * np.sin((0.5 + 0.1 * k) * time + k) for k in range(len(names))], axis=1)
    units = {"push": "m"}
    columns = {"time_s": time}
    for k, name in enumerate(names):
        columns[f"position_{units.get(name, 'rad')}.{name}"] = q[:, k]
        columns[f"motor_torque_n{'' if name in units else 'm'}.{name}"] = np.sin(time + k)
    np.savez(folder / "log.npz", **columns)
    return folder / "log.npz", q


@pytest.mark.parametrize("robot", ["own", "rounded_arm"])
def test_frames_and_masses_move_as_pinocchio_s(robot: str, tmp_path: Path):
    path = ARM
    if robot == "own":
        path = tmp_path / "own.urdf"
        path.write_text(urdf(SOLID), encoding="utf-8")
    log, q = written_log(tmp_path, path if robot != "own" else urdf(SOLID))
    known = pin.buildModelFromUrdf(str(path))
    data, loaded = known.createData(), load_robot(path, snap=0.0)

    found = viewed(loaded, log)

    drawn, chain = scene(found), loaded.mechanism
    rows = np.linspace(0, len(q) - 1, len(found.times)).astype(int)
    segments = {each["name"]: each["items"] for each in drawn["layers"] if each["kind"] == "segments"}
    assert len(segments["joint axes"]) == len(chain)
    for pose in (0, 7, len(rows) - 1):
        own = np.concatenate(
            [_of_pinocchio(known, name, q[rows[pose], k]) for k, name in enumerate(chain.joint_names)]
        )
        pin.framesForwardKinematics(known, data, own)
        for k, name in enumerate(chain.joint_names):
            place = data.oMi[known.getJointId(name)]
            np.testing.assert_allclose(found.poses[pose, k, 9:], place.translation, atol=1e-12)
            ends = [moved(found, pose, end) for end in segments["joint axes"][k]["ends"]]
            middle = 0.5 * (ends[0] + ends[1])
            np.testing.assert_allclose(middle, place.translation, atol=1e-5)
        frame = chain.frames[0]
        tip = data.oMf[known.getFrameId(frame.name)].translation
        at = [frame.joint, *frame.placement.translation.tolist()]
        np.testing.assert_allclose(moved(found, pose, at), tip, atol=1e-12)
        centre = sum(each.mass * moved(found, pose, [each.joint, *each.com]) for each in found.layers[FILE])
        mass = sum(each.mass for each in found.layers[FILE])
        np.testing.assert_allclose(centre / mass, pin.centerOfMass(known, data, own), atol=1e-12)


def _of_pinocchio(known: pin.Model, name: str, value: float) -> list[float]:
    return [math.cos(value), math.sin(value)] if known.joints[known.getJointId(name)].nq == 2 else [value]


def test_each_link_of_a_urdf_is_drawn_and_bodies_at_rest():
    found = viewed(load_robot_text(urdf(SOLID), "urdf"))

    assert [each.link for each in found.layers[FILE]] == ["arm", "slide", "tool"]
    assert [each.joint for each in found.layers[FILE]] == [0, 1, 1]
    assert found.faults == ()
    assert found.poses.shape == (1, 2, 12)


def test_what_no_body_can_be_is_said_first_and_has_its_own_colour():
    broken = '<inertia ixx="0.002" iyy="0.02" izz="0.5" ixy="0" ixz="0" iyz="0"/>'
    dense = urdf(broken, tool=1e5)

    found = viewed(load_robot_text(dense, "urdf"))

    assert found.faults == (
        "link 'arm': principal moments break the triangle inequality (0.002 + 0.02 < 0.5 kg m^2)",
        f"link 'tool': its ellipsoid has {found.layers[FILE][2].density:.3g} kg/m^3, more than any metal",
    )
    layers = {each["name"]: each for each in scene(found)["layers"]}
    bad = layers["file: inertia, not physical"]
    assert (bad["colour"], len(bad["items"])) == (NOT_PHYSICAL, 2)
    assert len(layers["file: inertia"]["items"]) == 1
    text = page(found, "")
    assert text.index("break the triangle inequality") < text.index('id="plot"')


def test_the_densest_possible_body_is_no_fault():
    """A solid ball of osmium, 22 590 kg/m^3; and one a hundredth denser than the limit."""
    for density, is_fault in ((22_590.0, False), (22_830.0, True)):
        mass = density * 4.0 / 3.0 * math.pi * 0.05**3
        inertia = 0.4 * mass * 0.05**2
        six = np.array([inertia, 0.0, inertia, 0.0, 0.0, inertia])
        assert (
            bool(body("ball", 0, Placement.identity(), standard_parameters(mass, np.zeros(3), six)).fault)
            is is_fault
        )


def test_assumed_zeros_of_a_dh_table_are_not_judged():
    assert viewed(load_robot(robot_path("scara_zeros"))).faults == ()


class Scripts(HTMLParser):
    """The elements of a page, and the text of each script."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.scripts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data: str) -> None:
        if self.scripts and self.tags[-1] == "script":
            self.scripts[-1] += data


def test_names_of_a_file_stay_text(tmp_path: Path):
    plain, evil = (
        page(viewed(load_robot_text(urdf(SOLID, mass=1e6, name=name), "urdf")), "") for name in ("arm", EVIL)
    )
    parsed = []
    for text in (plain, evil):
        parsed.append(Scripts())
        parsed[-1].feed(text)

    assert parsed[1].tags == parsed[0].tags
    assert "<script>alert" not in evil
    drawn = json.loads(parsed[1].scripts[1])
    labels = [item["label"] for layer in drawn["layers"] for item in layer["items"]]
    assert any(label.startswith("&lt;script&gt;alert(&#x27;1&#x27;)") for label in labels)
    assert not any("<script" in label for label in labels)


def test_json_in_a_page_ends_no_element():
    value = {"log": "</script><!--<script>&amp;\u2028.csv"}

    text = embedded(value)

    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == value


def test_a_page_loads_nothing():
    text = page(viewed(load_robot(robot_path("two_link"))), "")

    assert "default-src 'none'" in text
    assert "http://" not in text
    assert "https://" not in text


def test_a_long_log_gives_a_page_of_bounded_size(tmp_path: Path):
    log, _ = written_log(tmp_path, urdf(SOLID), rows=20_000)

    found = viewed(load_robot_text(urdf(SOLID), "urdf"), log)

    assert len(found.times) == MOST_POSES
    assert found.times[0] == 0.0
    assert found.times[-1] == pytest.approx(199.99)
    assert set(found.logs) == {"log.npz"}
    np.testing.assert_allclose(found.poses[-1, 0, 9:], [0.0, 0.0, 0.2])
    assert len(json.dumps(scene(found))) < 100_000


@pytest.mark.parametrize("fault", ["other names", "nan", "back in time"])
def test_logs_that_cannot_be_used_are_refused_as_in_calibration(fault: str, tmp_path: Path):
    log, _ = written_log(tmp_path, urdf(SOLID))
    columns = dict(np.load(log))
    if fault == "other names":
        columns = {name.replace("turn", "spin"): values for name, values in columns.items()}
    elif fault == "nan":
        columns["position_rad.turn"][7] = np.nan
    else:
        columns["time_s"][7] = -1.0
    np.savez(log, **columns)

    with pytest.raises(InputError, match=r"log\.npz: "):
        viewed(load_robot_text(urdf(SOLID), "urdf"), log)


def test_a_floating_robot_at_rest_and_no_log_of_it(tmp_path: Path):
    log, _ = written_log(tmp_path, urdf(SOLID))
    robot = load_robot_text(urdf(SOLID), "urdf", floating=True)

    assert len(viewed(robot).poses[0]) == 3
    with pytest.raises(InputError, match="the motion of a log is of joints of one coordinate"):
        viewed(robot, log)


def test_a_model_with_a_load_shows_the_load():
    file = load_robot_text(urdf(SOLID), "urdf")
    model = derive_model(file.mechanism, provenance=provenance_of(file))
    loaded = model.with_payload(0.5, [0.0, 0.0, 0.02], 1e-4 * np.eye(3))

    masses = [[each.mass for each in viewed(one).layers[FILE]] for one in (model, loaded)]

    assert masses == [[2.0, 1.0, 0.3], [2.0, pytest.approx(1.8)]]


def test_other_files_are_not_replaced(tmp_path: Path):
    target = tmp_path / "arm.html"
    require_own_page(target)
    target.write_text("<html>mine</html>", encoding="utf-8")
    with pytest.raises(InputError, match="psdmc did not write this file"):
        require_own_page(target)
    target.write_text(page(viewed(load_robot(robot_path("two_link"))), ""), encoding="utf-8")
    require_own_page(target)


def test_without_plotly_the_remedy_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)

    with pytest.raises(InputError, match="plotly, which is not installed") as raised:
        write_view(viewed(load_robot(robot_path("two_link"))), tmp_path / "arm.html")

    assert raised.value.hint == "pip install 'psdmc[view]'"
    assert not list(tmp_path.iterdir())


def test_the_command_writes_its_page_twice_and_says_faults(tmp_path: Path):
    pytest.importorskip("plotly")
    (tmp_path / "arm.urdf").write_text(urdf(SOLID, mass=1e6), encoding="utf-8")
    written_log(tmp_path, urdf(SOLID))

    first, again = (typed("view", "arm.urdf", *words, cwd=tmp_path) for words in ([], ["log.npz"]))

    assert (first.returncode, again.returncode) == (0, 0), again.stderr
    assert first.stdout.startswith("not physical: link 'arm': its ellipsoid has ")
    assert first.stdout.endswith("arm.html: open it in a browser\n")
    text = (tmp_path / "arm.html").read_text(encoding="utf-8")
    assert MARK in text[:1000]
    assert 'id="slider"' in text


@pytest.mark.slow
def test_the_same_page_for_every_hash_seed(tmp_path: Path):
    pytest.importorskip("plotly")
    for seed in ("1", "2"):
        done = started("view", ARM, "-o", tmp_path / f"{seed}.html", PYTHONHASHSEED=seed)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "1.html").read_bytes() == (tmp_path / "2.html").read_bytes()


def test_the_command_refuses_what_it_cannot_read_or_replace(tmp_path: Path):
    (tmp_path / "arm.urdf").write_text(urdf(SOLID), encoding="utf-8")
    (tmp_path / "arm.html").write_text("mine", encoding="utf-8")

    foreign = typed("view", "arm.urdf", cwd=tmp_path)
    missing = typed("view", "no.urdf", cwd=tmp_path)
    itself = typed("view", "arm.urdf", "-o", "arm.urdf", cwd=tmp_path)

    assert {foreign.returncode, missing.returncode, itself.returncode} == {2}
    assert foreign.stderr.startswith("error: arm.html: psdmc did not write this file")
    assert "would overwrite arm.urdf" in itself.stderr
    assert (tmp_path / "arm.html").read_text(encoding="utf-8") == "mine"
