"""The cost against the number of joints is that of the LBR7 with an eighth joint, too."""

from psdmc.bench.__main__ import SEED, eight_joints
from psdmc.bench.case import generic_chain
from psdmc.bench.cases import bundled_chain
from psdmc.derivation.derive import derive_model


def test_the_eighth_joint_has_a_coordinate_of_its_own() -> None:
    chain = generic_chain(eight_joints(bundled_chain("LBR7")), SEED)
    assert (len(chain), chain.nq) == (8, 8)
    assert derive_model(chain, expand=False).l == 50
