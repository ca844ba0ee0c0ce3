"""Planned motions hit nothing, by Pinocchio's own collision check of every row; what is not looked at is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from arms import LENGTH, pinocchio_of, urdf

from psdmc.calibration.campaign_plan import CampaignOptions, allowed_of, plan_campaign
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.motions.allowed import GivenLimits, bounded
from psdmc.calibration.motions.clearance import APART, clearance_of, floor_points, mesh_file, spread
from psdmc.calibration.motions.criterion import all_columns, scaled
from psdmc.calibration.motions.excite import excite
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.limited_sines import LimitedSines, SineSum
from psdmc.calibration.motions.sweeps import SineOptions, SweepOptions
from psdmc.compiler import derive
from psdmc.errors import InputError
from psdmc.robot.urdf.pinocchio_text import JOINT_PREFIX

OPTIONS = CampaignOptions(
    sweep=SweepOptions(seconds=20.0, period=4e-3),
    sines=SineOptions(smallest=1e-2, ratio=4.0, period=4e-3),
    excite=ExciteOptions(duration=5.0, samples=50, evaluations=40, random=20),
    limits=GivenLimits(acceleration=12.0),
    gravity_runs=2,
    repeats=1,
)


def model_of(folder: Path, text: str):
    file = folder / "crane.urdf"
    file.write_text(text, encoding="utf-8")
    return derive(file)


def test_the_same_poses_collide_as_in_pinocchios_own_reading(tmp_path: Path):
    robot, shapes = pinocchio_of(tmp_path, urdf())
    clearance = clearance_of(derive(tmp_path / "crane.urdf"))
    data, shaped = robot.createData(), shapes.createData()
    for request in shaped.collisionRequests:
        request.security_margin = APART
    poses = np.random.default_rng(2).uniform(-2.6, 2.6, (300, 3))

    hits = [pin.computeCollisions(robot, data, shapes, shaped, pose, True) for pose in poses]

    assert 20 < sum(hits) < 280
    assert [clearance.first_touch(pose[None]) is not None for pose in poses] == hits


def test_all_runs_of_a_campaign_are_free(tmp_path: Path):
    """Row by row, by Pinocchio; and without the check some are not."""
    robot, shapes = pinocchio_of(tmp_path, urdf())
    model = derive(tmp_path / "crane.urdf")
    floor = 0.2

    plan = plan_campaign(model, ChainRegressor(model), replace(OPTIONS, floor=floor))
    unlooked = plan_campaign(model, ChainRegressor(model), replace(OPTIONS, shapes=None))

    def hits(run) -> bool:
        data, shaped = robot.createData(), shapes.createData()
        return any(pin.computeCollisions(robot, data, shapes, shaped, q, True) for q in run.motion.q[::10])

    def lowest(run) -> float:
        """Height of the lower link's far end, by Pinocchio."""
        data, heights = robot.createData(), []
        for q in run.motion.q[::10]:
            pin.forwardKinematics(robot, data, q)
            heights.append((data.oMi[3] * np.array([0.0, 0.0, 0.45]))[2])
        return min(heights)

    assert [run.name for run in plan.runs if hits(run)] == []
    assert min(lowest(run) for run in plan.runs) > floor
    assert [run.name for run in unlooked.runs if hits(run)]
    assert min(lowest(run) for run in unlooked.runs) < floor
    assert any(line.startswith("self-collision: ") for line in plan.looked)
    assert any(line.startswith("floor at 0.2 m: shapes stay 10 mm above") for line in plan.looked)
    assert any("as asked for (--no-collisions)" in line for line in unlooked.looked)
    assert any("of its size, larger ones are not allowed" in remark for remark in plan.remarks)


def test_what_cannot_be_looked_at_is_said(tmp_path: Path):
    one = replace(OPTIONS, one_log=True)
    mesh = urdf().replace('<box size="0.08 0.08 0.4"/>', '<mesh filename="package://crane/upper.stl"/>')
    model = model_of(tmp_path, mesh)

    plan = plan_campaign(model, ChainRegressor(model), one)

    said = next(line for line in plan.looked if "self-collision" in line)
    assert said.startswith("not checked: self-collision, crane.urdf: collision shape of link 'upper': mesh")
    assert "--meshes DIR" in said
    with pytest.raises(InputError, match="is in none of the given folders"):
        plan_campaign(model, ChainRegressor(model), replace(one, shapes=(tmp_path,)))
    bare = model_of(tmp_path, urdf(shapes=False))
    plan = plan_campaign(bare, ChainRegressor(bare), one)
    assert (
        "not checked: self-collision, crane.urdf has no collision shapes (add <collision> to its links)"
        in plan.looked
    )
    assert any(line.startswith("not checked: floor") for line in plan.looked)


def test_a_floor_needs_no_shapes(tmp_path: Path):
    """Origins of joints and the tip are held against it: here the tip is the lower link's frame, 0.45 + 0.5 cos(lift)."""
    model = model_of(tmp_path, urdf(shapes=False))
    floor = floor_points(model.chain, 0.3)
    for lift in (0.5, 1.5, 1.9, 2.5):
        height = 0.45 + LENGTH * np.cos(lift)

        touched = floor.first_touch(np.array([[0.3, lift, 0.0]]))

        assert (touched is not None) == (height < 0.3 + APART)
    touched = floor.first_touch(np.array([[0.3, 2.5, 0.0]]))
    assert str(touched).startswith("the origin of joint 'bend' and the floor come within 10 mm")


def stl(triangles: np.ndarray) -> str:
    """Triangles (N, 3, 3) as a text file."""
    facets = [
        f"facet normal 0 0 0\nouter loop\n{''.join('vertex {} {} {} '.format(*x) for x in own)}\nendloop\nendfacet\n"
        for own in triangles
    ]
    return f"solid bent\n{''.join(facets)}endsolid bent\n"


@pytest.mark.parametrize(("is_flat", "floor"), [(False, -0.1), (True, 0.25)])
def test_a_mesh_is_above_the_floor_where_its_lowest_vertex_is(tmp_path: Path, is_flat: bool, floor: float):
    """A bent mesh, and a flat one, which has no hull: by the vertices' heights, from Pinocchio's frames."""
    places = np.random.default_rng(5).uniform(-0.3, 0.3, (8, 3, 3)) * [1.0, 1.0, 0.0 if is_flat else 1.0]
    (tmp_path / "crane").mkdir()
    (tmp_path / "crane" / "upper.stl").write_text(stl(places), encoding="utf-8")
    mesh = '<collision><geometry><mesh filename="package://crane/upper.stl" scale="1 1 2"/></geometry></collision>'
    model = model_of(
        tmp_path, urdf(shapes=False).replace('<link name="upper">', f'<link name="upper">{mesh}')
    )
    clearance = clearance_of(model, (tmp_path,), floor)
    data, heights = clearance.model.createData(), []
    poses = np.random.default_rng(2).uniform(-2.6, 2.6, (300, 3))
    for pose in poses:
        pin.forwardKinematics(clearance.model, data, pose)
        place = data.oMi[clearance.model.getJointId(JOINT_PREFIX + "lift")]
        heights.append(min(place.act(x * [1.0, 1.0, 2.0])[2] for x in places.reshape(-1, 3)))

    found = [clearance.first_touch(pose[None]) for pose in poses]

    assert [text is not None for text in found] == [height < floor + APART for height in heights]
    assert 20 < sum(text is not None for text in found) < 280
    assert {text.split(" come")[0] for text in found if text} == {"link 'upper' and the floor"}
    pairs = [
        clearance.shapes.geometryObjects[pair.first].geometry for pair in clearance.shapes.collisionPairs
    ]
    assert [hasattr(shape, "buildConvexHull") for shape in pairs] == [is_flat], "meshes themselves take long"


def test_meshes_are_read_below_the_given_folders_alone(tmp_path: Path):
    inside = tmp_path / "robots" / "crane"
    inside.mkdir(parents=True)
    (inside / "upper.stl").write_bytes(b"solid x\nendsolid x\n")
    (tmp_path / "secret.stl").write_bytes(b"solid x\nendsolid x\n")
    (inside / "notes.txt").write_text("no mesh", encoding="utf-8")

    found = mesh_file("package://crane/upper.stl", "here", (tmp_path / "robots",))

    assert found == (inside / "upper.stl").resolve()
    for name in (
        "package://crane/../../secret.stl",
        "../secret.stl",
        str(tmp_path / "secret.stl"),
        "a\0b.stl",
    ):
        with pytest.raises(InputError, match="is in none of the given folders"):
            mesh_file(name, "here", (tmp_path / "robots",))
    with pytest.raises(InputError, match="is no mesh"):
        mesh_file("package://crane/notes.txt", "here", (tmp_path / "robots",))


def test_poses_between_rows_are_looked_at():
    path = np.array([[0.0, 0.0], [0.05, 0.0], [0.05, 0.3], [0.05, 0.3], [0.0, 0.3]])

    poses = np.array(list(spread(path, 0.02)))

    assert np.abs(np.diff(poses, axis=0)).max() <= 0.02 + 1e-12
    for row in path:
        assert np.abs(poses - row).max(axis=1).min() <= 0.02


@pytest.mark.parametrize("random", [pytest.param(1000, marks=pytest.mark.slow), 30])
def test_a_motion_is_never_worse_than_the_best_random_one_that_hits_nothing(tmp_path: Path, random: int):
    """Each random motion here is made smaller until nothing forbids it, without the search's shortcuts; and the search has
    no time."""
    model = model_of(tmp_path, urdf())
    regressor = ChainRegressor(model)
    chain = bounded(model.mechanism, GivenLimits(acceleration=12.0))
    allowed = allowed_of(model, chain, regressor, 0.8, (), None)
    columns = all_columns(regressor, model.l, LinearOptions())
    options = ExciteOptions(duration=5.0, samples=50, evaluations=1, random=random, seconds=0.0)

    found = excite(chain, columns, options, allowed=allowed)

    space, scores = LimitedSines(chain, options), []

    def deviation(motion: SineSum) -> float:
        return scaled(columns.at(*motion.at(np.arange(space.samples) * 5.0 / space.samples))).deviation

    stricter = replace(allowed, torque_margin=0.99 * 0.8)
    for point in space.drawn(random, np.random.default_rng(options.seed)):
        motion = space.motion(point)
        for share in 0.97 ** np.arange(60):
            small = motion.shrunk(share)
            if not stricter.faults(small.sampled(chain.joint_names, 5.0 / 200)):
                scores.append(deviation(small))
                break
    assert len(scores) > 0.5 * random
    assert deviation(found.motion) <= 1.001 * min(scores)
    assert found.times == pytest.approx(min(scores) / deviation(found.motion), rel=0.03)
    assert found.times >= 1.0
    assert allowed.faults(found.motion.sampled(chain.joint_names, 5.0 / 1000)) == []
