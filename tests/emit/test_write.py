"""Writing a package: unchanged files left alone, foreign ones never touched, no half-written file."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from small import pendulum, pendulum_info

from psdmc.emit import write
from psdmc.emit.options import EmitOptions
from psdmc.emit.package import package_files
from psdmc.emit.write import write_package
from psdmc.errors import InputError, ToolchainError

FILES = package_files(pendulum())


def _stamps(folder: Path) -> dict[str, int]:
    return {
        str(path.relative_to(folder)): path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()
    }


def test_all_files_are_written_and_nothing_else(tmp_path: Path) -> None:
    assert write_package(tmp_path / "new" / "arm", FILES) == list(FILES)
    assert set(_stamps(tmp_path / "new" / "arm")) == set(FILES)
    for path, text in FILES.items():
        assert (tmp_path / "new" / "arm" / path).read_bytes() == text.encode()


def test_unchanged_files_are_left_alone(tmp_path: Path) -> None:
    write_package(tmp_path, FILES)
    for path in FILES:
        os.utime(tmp_path / path, ns=(1, 1))

    assert write_package(tmp_path, FILES) == []
    assert set(_stamps(tmp_path).values()) == {1}


def test_only_what_changed_is_written_and_stale_files_go(tmp_path: Path) -> None:
    write_package(tmp_path, FILES)
    single = package_files(pendulum(options=EmitOptions(real="float32")))
    single.pop("src/pivots.h")

    changed = write_package(tmp_path, single)

    assert "src/internal.h" in changed
    assert "LICENSE" not in changed
    assert "cmake/pendulumConfig.cmake.in" not in changed


def test_files_of_another_function_set_are_removed(tmp_path: Path) -> None:
    write_package(
        tmp_path, {**FILES, "src/old.c": "int x;\n", "manifest.json": _with(FILES, "src/old.c", "int x;\n")}
    )
    assert "src/old.c" in write_package(tmp_path, FILES)
    assert not (tmp_path / "src/old.c").exists()


def _with(files: dict[str, str], path: str, text: str) -> str:
    content = json.loads(files["manifest.json"])
    content["files"][path] = write.digest(text)
    return json.dumps(content)


def test_a_file_that_psdmc_did_not_write_stays(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("mine")
    with pytest.raises(InputError, match=r"not overwriting README\.md") as caught:
        write_package(tmp_path, FILES)
    assert "--force" in str(caught.value.hint)
    assert set(_stamps(tmp_path)) == {"README.md"}, "something was written before the refusal"

    write_package(tmp_path, FILES, force=True)
    assert (tmp_path / "README.md").read_text() == FILES["README.md"]


def test_a_file_edited_since_stays_too(tmp_path: Path) -> None:
    write_package(tmp_path, FILES)
    (tmp_path / "src/inverse_dynamics.c").write_text("/* better */")
    with pytest.raises(InputError, match=r"not overwriting src/inverse_dynamics\.c"):
        write_package(tmp_path, FILES)


def test_another_programs_manifest_is_foreign(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text('{"name": "web app"}')
    with pytest.raises(InputError, match=r"not overwriting manifest\.json"):
        write_package(tmp_path, FILES)


def test_a_forged_manifest_cannot_reach_out_of_its_folder(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("keep")
    forged = {
        "generator": "psdmc",
        "files": {"../victim": write.digest("keep"), str(victim): write.digest("keep")},
    }
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "manifest.json").write_text(json.dumps(forged))
    write_package(tmp_path / "arm", FILES, force=True)
    assert victim.read_text() == "keep"


def test_a_folder_that_cannot_be_made_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ToolchainError, match="cannot be written") as caught:
        write_package(tmp_path / "file" / "arm", FILES)
    assert "\n" not in caught.value.message
    assert "-o" in str(caught.value.hint)


def test_an_interrupted_write_leaves_the_old_file_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_package(tmp_path, FILES)
    other = package_files(pendulum(pendulum_info(joint="elbow")))

    def interrupted(source: str, target: object) -> None:
        raise OSError(28, "No space left on device", str(target))

    monkeypatch.setattr("psdmc.emit.write.os.replace", interrupted)
    with pytest.raises(ToolchainError, match="No space left"):
        write_package(tmp_path, other)
    assert {path: (tmp_path / path).read_text() for path in FILES} == FILES
    assert set(_stamps(tmp_path)) == set(FILES), "a temporary file stays behind"
