"""Files without some inertias through the commands that a user types."""

from __future__ import annotations

from pathlib import Path

from command_line import typed
from urdf_text import BALL, joint, link, urdf


def two_links(folder: Path) -> Path:
    path = folder / "arm.urdf"
    path.write_text(
        urdf(
            *(link("base", ""), link("upper", BALL), link("hand", "")),
            joint("j1", "base", "upper", kind="continuous", axis="1 0 0"),
            joint("j2", "upper", "hand", kind="continuous", axis="0 1 0"),
        )
    )
    return path


def test_a_massless_tip_is_said_by_derive_and_by_emit_c(tmp_path: Path) -> None:
    derived = typed("derive", two_links(tmp_path), "-o", "arm.npz", cwd=tmp_path)
    assert derived.returncode == 0, derived.stderr
    assert derived.stdout.splitlines()[1] == (
        "warning: link 'hand' has no <inertial>: treated as massless. Joint 'j2' moves no inertia: forward dynamics cannot "
        "be generated. Add <inertial>, or keep its parameters as unknowns with --unknown hand."
    )
    refused = typed("emit-c", "arm.npz", cwd=tmp_path)
    assert refused.returncode == 2
    assert (
        "error: model 'arm': no forward_dynamics: joint 'j2' moves no inertia, because link 'hand' has no <inertial>"
        in refused.stderr
    )
    assert (
        "hint: add <inertial>, or derive again with --unknown hand; without forward_dynamics: --functions "
        in refused.stderr
    )


def test_an_unknown_tip_is_derived_shown_and_emitted(tmp_path: Path) -> None:
    derived = typed("derive", two_links(tmp_path), "--unknown", "hand", "-o", "arm.npz", cwd=tmp_path)
    assert derived.returncode == 0, derived.stderr
    assert "warning" not in derived.stdout
    shown = typed("show", "arm.npz", cwd=tmp_path)
    assert "base parameters contain unknown parameters of 'hand'" in " ".join(shown.stdout.split())
    emitted = typed("emit-c", "arm.npz", "-o", "arm_c", "--functions", "gravity", cwd=tmp_path)
    assert emitted.returncode == 0, emitted.stderr
    assert (tmp_path / "arm_c" / "manifest.json").exists()
