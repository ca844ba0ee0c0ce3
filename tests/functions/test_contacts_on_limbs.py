"""Contacts on equal limbs, which are eliminated one by one: against dense systems of Pinocchio's numbers."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from direct import Direct
from installed import in_wheel
from slow_cases import slow_but_for
from unoptimised import compiled

from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.program.interpret import interpret
from psdmc.program.kernel import Kernel
from psdmc.program.limb_program import unpacked
from psdmc.program.signature import Sizes
from psdmc.robot.load import LoadedRobot, load_robot, load_robot_text
from psdmc.robot.reference import reference

Array = np.ndarray

FUNCTIONS = (
    "constrained_forward_dynamics",
    "constrained_forward_dynamics_derivatives",
    "impulse",
    "impulse_derivatives",
)
FEET = ("lf_foot", "rf_foot", "lh_foot", "rh_foot")
CONTACTS = {
    "hyq_no_sensors.urdf": FEET,
    "allegro_right_hand.urdf": tuple(f"link_{k}.0_tip" for k in (3, 7, 11, 15)),
    "b1-z1.urdf": ("FL_foot", "FR_foot", "RL_foot", "RR_foot"),
    "g1_29dof_rev_1_0.urdf": ("left_ankle_roll_link:6", "right_ankle_roll_link:6"),
}
"""A quadruped; a hand without a core; a quadruped whose core has an arm; a humanoid on two surfaces."""
COUNT = 24


@cache
def loaded_of(file: str, contacts: tuple[str, ...]) -> LoadedRobot:
    floating = file != "allegro_right_hand.urdf"
    return load_robot(in_wheel(file), floating=floating, contacts=list(contacts))


@cache
def model_of(file: str, contacts: tuple[str, ...]) -> DynamicsModel:
    return derive_model(loaded_of(file, contacts).mechanism, expand=False)


@cache
def kernels_of(file: str, contacts: tuple[str, ...]) -> dict[str, Kernel]:
    return lower(model_of(file, contacts), functions=FUNCTIONS, theta_variants=False)


def given_to(model: DynamicsModel, name: str, mu: float = 0.0) -> dict[str, Array]:
    """Random states with random masks and gains."""
    random, sizes = np.random.default_rng(5), Sizes.of(model.mechanism, model.l)
    given = {
        each.name: each.drawn(random.uniform(-1.0, 1.0, (COUNT, sizes.size(each))))
        for each in RECIPES[name].signature.inputs
    }
    q, qd, tau = states_of(model.mechanism, random, COUNT)
    given |= {"q": q, "mu": np.full((COUNT, 1), mu), "qd": qd, "tau": tau}
    return {each.name: given[each.name] for each in RECIPES[name].signature.inputs}


@pytest.mark.parametrize(
    ("file", "name"),
    slow_but_for(
        [("hyq_no_sensors.urdf", FUNCTIONS[1]), ("allegro_right_hand.urdf", FUNCTIONS[3])],
        [(file, name) for file in CONTACTS for name in FUNCTIONS],
        spread=True,
    ),
)
def test_limb_by_limb_as_the_dense_system(file: str, name: str) -> None:
    """mu = 0. States at which a leg is almost straight are left to the dense system: at most every fifth."""
    model, kernel = model_of(file, CONTACTS[file]), kernels_of(file, CONTACTS[file])[name]
    assert kernel.limbs is not None
    assert kernel.limbs.checked
    given = given_to(model, name)
    expected = RECIPES[name].pinocchio(reference(loaded_of(file, CONTACTS[file])), given)
    found = interpret(
        unpacked(kernel.limbs), given, kernel.function.sizes(Sizes.of(model.mechanism, model.l))
    )
    settled = (found["pivot"] > 0.0).all(axis=1)
    assert settled.mean() > 0.8
    bound = 1e-8 if name.endswith("derivatives") else 1e-10
    for output, values in expected.items():
        flat = values.reshape(COUNT, -1)
        error = np.abs(found[output] - flat).max(axis=1)
        assert (error <= bound * np.abs(flat).max(axis=1))[settled].all(), output


def test_a_straight_knee_is_left_to_the_dense_system() -> None:
    model, name = model_of("hyq_no_sensors.urdf", FEET), FUNCTIONS[0]
    limbs = kernels_of("hyq_no_sensors.urdf", FEET)[name].limbs
    assert limbs is not None
    whole, sizes = unpacked(limbs), RECIPES[name].signature.sizes(Sizes.of(model.mechanism, model.l))
    for active, mu, settled in [(1.0, 0.0, False), (0.0, 0.0, True), (1.0, 0.5, True)]:
        given = given_to(model, name, mu)
        given["q"][:, 7:] = np.tile([0.1, 0.7, -1.4], 4)
        given["q"][:, 9] = 0.0  # lf_kfe_joint
        given["active"][:, 0] = active
        signs = interpret(whole, given, sizes)["pivot"][:, model.nv :]
        assert ((signs[:, 0] > 0.0) == settled).all()
        assert (signs[:, 1:] > 0.0).all()


def test_limbs_with_other_contacts_are_not_eliminated_one_by_one() -> None:
    """Two feet of four, a contact on the trunk, and legs with fewer joints than rows."""
    for contacts in (FEET[:2], (*FEET, "trunk"), tuple(f"{foot}:6" for foot in FEET)):
        model = model_of("hyq_no_sensors.urdf", contacts)
        assert lower(model, functions=FUNCTIONS[:1], theta_variants=False)[FUNCTIONS[0]].limbs is None


@pytest.mark.parametrize("name", slow_but_for([FUNCTIONS[0]], list(FUNCTIONS)))
def test_c_takes_the_dense_system_where_it_must(name: str) -> None:
    """One state at a time: bent and straight knees, outputs over inputs, and a state without a solution."""
    model = model_of("hyq_no_sensors.urdf", FEET)
    names = (name, *RECIPES[name].signature.calls)
    info = package_info(model, "hyq")
    package = package_view(info, lower(model, functions=names, theta_variants=False), EmitOptions())
    call = Direct(package, compiled(package, False))
    given, signature = given_to(model, name), RECIPES[name].signature
    given["q"][::3, 9] = 0.0
    expected = RECIPES[name].pinocchio(reference(loaded_of("hyq_no_sensors.urdf", FEET)), given)
    sizes = signature.sizes(Sizes.of(model.mechanism, model.l))
    bound = 1e-8 if name.endswith("derivatives") else 1e-10
    for row in range(COUNT):
        inputs = [given[each.name][row].copy() for each in signature.inputs]
        outputs = {each.name: np.empty(sizes[each.name]) for each in signature.outputs}
        assert call(name, *inputs, *outputs.values()) == 0
        for output, found in outputs.items():
            values = expected[output][row].ravel()
            assert np.abs(found - values).max() <= bound * np.abs(values).max(), output
        first = signature.outputs[0].name
        assert call(name, *inputs, inputs[1], *list(outputs.values())[1:]) == 0
        np.testing.assert_array_equal(inputs[1], outputs[first])
    inputs = [given[each.name][0].copy() for each in signature.inputs]
    inputs[[each.name for each in signature.inputs].index("active")][2] = 0.5
    assert call(name, *inputs, *outputs.values()) == 1 + model.nv + 2
    assert all(np.isnan(found).all() for found in outputs.values())


BODY = (
    '<inertial><origin xyz="{place}"/><mass value="{mass}"/>'
    '<inertia ixx="{i}" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>'
)
AXES = ("1 0 0", "0 1 0", "0 1 0", "0 0.6 0.8")


def branches(*groups: tuple[str, int, int], follows: bool = False, planar: bool = False) -> LoadedRobot:
    """A body with groups of equal limbs (name, joints, limbs). The last joint may follow the one before; in planar limbs all
    axes are parallel. The limbs whose names begin with `leg` touch the world at their ends."""
    text = [f'<robot name="r"><link name="body">{BODY.format(place="0.01 0 0.02", mass=8, i=0.2)}</link>']
    feet = []
    for name, joints, limbs in groups:
        for limb in range(limbs):
            parent = "body"
            for k in range(joints):
                link = f"{name}{limb}_{k}"
                place = (
                    f"{0.3 - 0.6 * (limb % 2)} {0.2 - 0.4 * (limb // 2)} 0.05" if k == 0 else "0 0.06 -0.25"
                )
                leader = f'<mimic joint="to_{name}{limb}_{k - 1}" multiplier="0.8" offset="0.1"/>'
                leader = leader if follows and k == joints - 1 else ""
                text.append(
                    f'<link name="{link}">{BODY.format(place="0.01 0.02 -0.1", mass=1 + k, i=0.02)}</link>'
                    f'<joint name="to_{link}" type="revolute"><parent link="{parent}"/><child link="{link}"/>'
                    f'<origin xyz="{place}"/><axis xyz="{AXES[1] if planar else AXES[k]}"/>'
                    f'<limit lower="-2" upper="2" effort="9" velocity="9"/>{leader}</joint>'
                )
                parent = link
            feet.append(f"{name}{limb}_end")
            text.append(
                f'<link name="{feet[-1]}"/><joint name="to_{feet[-1]}" type="fixed"><parent link="{parent}"/>'
                f'<child link="{feet[-1]}"/><origin xyz="0.02 0.01 -0.3"/></joint>'
            )
    contacts = [foot for foot in feet if foot.startswith("leg")]
    return load_robot_text("".join(text) + "</robot>", "urdf", floating=True, contacts=contacts)


@pytest.mark.parametrize(
    ("joints", "options"), [(3, {"planar": True}), (3, {"follows": True}), (2, {})], ids=str
)
def test_limbs_that_cannot_hold_a_contact_alone(joints: int, options: dict[str, bool]) -> None:
    """Parallel axes, a joint that follows another, and two joints: fewer than three directions."""
    model = derive_model(branches(("leg", joints, 4), **options).mechanism, expand=False)
    assert lower(model, functions=FUNCTIONS[2:3], theta_variants=False)[FUNCTIONS[2]].limbs is None


def test_contacts_on_links_that_mimic() -> None:
    """Four joints of three rates, against the code without limbs."""
    model = derive_model(branches(("leg", 4, 4), follows=True).mechanism, expand=False)
    given = given_to(model, FUNCTIONS[3])
    kernel = lower(model, functions=FUNCTIONS[3:], theta_variants=False)[FUNCTIONS[3]]
    assert kernel.limbs is not None
    sizes = kernel.function.sizes(Sizes.of(model.mechanism, model.l))
    found, expected = (
        interpret(program, given, sizes) for program in (unpacked(kernel.limbs), kernel.single)
    )
    settled = (found["pivot"] > 0.0).all(axis=1)
    assert settled.mean() > 0.5
    for output in expected.keys() - {"pivot"}:
        error, size = (
            np.abs(each).max(axis=1) for each in (found[output] - expected[output], expected[output])
        )
        assert (error <= 1e-9 * size)[settled].all(), output


@pytest.mark.slow
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_group_without_contacts_in_c(name: str) -> None:
    loaded = branches(("leg", 3, 2), ("arm", 2, 2))
    model, signature = derive_model(loaded.mechanism, expand=False), RECIPES[name].signature
    kernels = lower(model, functions=(name, *signature.calls), theta_variants=False)
    assert kernels[name].limbs is not None
    package = package_view(package_info(model, "two"), kernels, EmitOptions())
    call, given = Direct(package, compiled(package, False)), given_to(model, name)
    expected, sizes = (
        RECIPES[name].pinocchio(reference(loaded), given),
        signature.sizes(Sizes.of(model.mechanism, model.l)),
    )
    for row in range(COUNT):
        outputs = {each.name: np.empty(sizes[each.name]) for each in signature.outputs}
        assert (
            call(name, *(given[each.name][row].copy() for each in signature.inputs), *outputs.values()) == 0
        )
        for output, found in outputs.items():
            values = expected[output][row].ravel()
            assert np.abs(found - values).max() <= 1e-8 * np.abs(values).max(), output
