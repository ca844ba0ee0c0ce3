"""Writing a package: unchanged files left alone, foreign ones never touched, no half-written file."""

from __future__ import annotations

import json
import os
import signal
import stat
from pathlib import Path

import pytest
from small import pendulum, pendulum_info

from psdmc.backends.c.back_end import package_files
from psdmc.backends.info import EmitOptions
from psdmc.backends.manifest import OWN_NAME, RENAMED, digest, edited_files
from psdmc.backends.package_folder import write_package
from psdmc.errors import InputError, ToolchainError
from psdmc.functions import RECIPES

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


def test_folders_that_become_empty_are_removed(tmp_path: Path) -> None:
    """`make fmu` would take a folder of that name for a target that is up to date."""
    old = {"fmu/old.c": "int x;\n", "wheel/old.c": "int x;\n"}
    listed = json.loads(FILES["manifest.json"])
    listed["files"] |= {path: digest(text) for path, text in old.items()}
    write_package(tmp_path, {**FILES, **old, "manifest.json": json.dumps(listed)})
    (tmp_path / "wheel/own.c").write_text("int y;\n", encoding="utf-8")

    write_package(tmp_path, FILES)

    assert not (tmp_path / "fmu").exists()
    assert [path.name for path in (tmp_path / "wheel").iterdir()] == ["own.c"]


def _with(files: dict[str, str], path: str, text: str) -> str:
    content = json.loads(files["manifest.json"])
    content["files"][path] = digest(text)
    return json.dumps(content)


def test_a_folder_of_others_is_not_written_to(tmp_path: Path) -> None:
    """Whatever its files are called: nothing of the package would be in their way."""
    for name in ("thesis.tex", "data", "zoo", "notes.txt", "a.c"):
        (tmp_path / name).write_text("mine")
    with pytest.raises(InputError) as caught:
        write_package(tmp_path, FILES)
    expected = f"{tmp_path}: psdmc did not write the files in this folder: a.c, data, notes.txt and 2 more"
    assert caught.value.message == expected
    assert "-o" in str(caught.value.hint)
    assert "--force" in str(caught.value.hint)
    assert len(_stamps(tmp_path)) == 5, "something was written before the refusal"


def test_one_file_of_others_is_enough(tmp_path: Path) -> None:
    (tmp_path / "src").mkdir()
    with pytest.raises(InputError, match=r"psdmc did not write the files in this folder: src\b"):
        write_package(tmp_path, FILES)
    with pytest.raises(InputError, match=r"/: psdmc did not write the files in this folder: .* and \d+ more"):
        write_package("/", FILES)


def test_a_folder_of_dot_files_is_free(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git" / "config").write_text("mine")
    (tmp_path / ".gitignore").write_text("build")
    assert write_package(tmp_path, FILES) == list(FILES)
    assert set(_stamps(tmp_path)) == {*FILES, ".git/config", ".gitignore"}


def test_a_link_to_a_folder_is_that_folder(tmp_path: Path) -> None:
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "notes.txt").write_text("mine")
    (tmp_path / "arm").symlink_to(tmp_path / "theirs")
    with pytest.raises(InputError, match=r"in this folder: notes\.txt"):
        write_package(tmp_path / "arm", FILES)
    (tmp_path / "theirs" / "notes.txt").unlink()
    assert write_package(tmp_path / "arm", FILES) == list(FILES)
    assert write_package(tmp_path / "arm", FILES) == []
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    with pytest.raises(InputError, match="nowhere: cannot be written"):
        write_package(tmp_path / "nowhere", FILES)


def test_force_writes_beside_files_of_others_and_deletes_none(tmp_path: Path) -> None:
    """Those in the way are kept under other names, every time."""
    theirs = {"README.md": "mine", "src/tables.c": "mine, too", "manifest.json": "{}", "notes.txt": "keep"}
    (tmp_path / "src").mkdir()
    for path, text in theirs.items():
        (tmp_path / path).write_text(text)
    (tmp_path / "README.md.orig").write_text("older")

    changes = write_package(tmp_path, FILES, force=True)

    kept = {
        "README.md": "README.md.orig1",
        "src/tables.c": "src/tables.c.orig",
        "manifest.json": "manifest.json.orig",
    }
    assert changes.kept == kept
    assert {path: (tmp_path / kept.get(path, path)).read_text() for path in theirs} == theirs
    assert (tmp_path / "README.md.orig").read_text() == "older"
    assert {path: (tmp_path / path).read_text() for path in FILES} == FILES
    before = _stamps(tmp_path)
    assert write_package(tmp_path, FILES) == [], "the folder has a package now"
    assert _stamps(tmp_path) == before


def test_what_was_removed_is_said(tmp_path: Path) -> None:
    write_package(tmp_path, FILES)
    fewer = {path: text for path, text in FILES.items() if not path.startswith("src/forward_dynamics")}
    fewer["manifest.json"] = FILES["manifest.json"].replace("pendulum_forward_dynamics", "pendulum_fd")
    changes = write_package(tmp_path, fewer)
    assert set(changes.removed) == set(FILES) - set(fewer)
    assert set(changes) == {"manifest.json", *changes.removed}
    assert (changes.kept, changes.renamed) == ({}, ())


def test_renamed_symbols_are_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package that an earlier psdmc wrote: its robot was called otherwise in C, and one of its functions was."""
    old = FILES["manifest.json"].replace('"robot": "pendulum"', '"robot": "swing"')
    old = old.replace('"name": "inverse_dynamics', '"name": "torques')
    write_package(tmp_path, {**FILES, "manifest.json": old})
    monkeypatch.setattr("psdmc.backends.manifest.RENAMED", {"torques": "inverse_dynamics", "gone": "gravity"})
    assert write_package(tmp_path, FILES).renamed == (
        ("swing_*", "pendulum_*"),
        ("swing_torques", "pendulum_inverse_dynamics"),
        ("swing_torques_theta", "pendulum_inverse_dynamics_theta"),
    )


@pytest.mark.parametrize(
    ("old", "replaced"),
    [
        ({"model_hash": "0"}, None),
        ({"name": "swing"}, None),
        ({"name": "swing", "model_hash": "0"}, ("'swing' (1 joint)", "'pendulum' (1 joint)")),
        ({"joints": [{"name": "a"}, {"name": "b"}]}, ("'pendulum' (2 joints)", "'pendulum' (1 joint)")),
        ({"joints": 3, "name": ["\n"]}, ("['\\n'] (0 joints)", "'pendulum' (1 joint)")),
    ],
    ids=str,
)
def test_another_robots_package_is_told_from_the_same_robots(
    old: dict[str, object], replaced: tuple[str, str] | None, tmp_path: Path
) -> None:
    """A robot that was calibrated, or is called otherwise in C, is the same robot."""
    manifest = json.dumps({**json.loads(FILES["manifest.json"]), **old})
    write_package(tmp_path, {**FILES, "manifest.json": manifest})
    assert write_package(tmp_path, FILES).replaced == replaced
    assert write_package(tmp_path, FILES).replaced is None


@pytest.mark.parametrize(
    "forged",
    ['"robot": "a\\nb"', '"robot": 7', '"robot": "pendulum", "functions": {"name": [[]]}',
     '"robot": "pendulum", "functions": [{"kernels": 3}, {"kernels": [[], {"name": []}]}, 1]'],
)  # fmt: skip
def test_a_forged_manifest_renames_nothing(forged: str, tmp_path: Path) -> None:
    text = f'{{"generator": "psdmc", "files": {{"LICENSE": "0"}}, {forged}}}'
    (tmp_path / "manifest.json").write_text(text)
    assert write_package(tmp_path, FILES).renamed == ()


DEFAULT_OF_0_1 = (
    *("inverse_dynamics", "forward_dynamics", "mass_matrix", "nonlinear_effects", "coriolis_matrix"),
    *("gravity", "regressor", "regressor_slotine_li", "jacobian"),
)
"""Functions of the packages that psdmc 0.1 wrote, by its CHANGELOG and its emitted headers."""


def test_every_function_of_release_0_1_is_there_or_known_as_renamed() -> None:
    assert [name for name in DEFAULT_OF_0_1 if RENAMED.get(name, name) not in RECIPES] == []


def test_a_file_edited_since_stays_too(tmp_path: Path) -> None:
    write_package(tmp_path, FILES)
    (tmp_path / "src/inverse_dynamics.c").write_text("/* better */")
    with pytest.raises(InputError, match=r"not overwriting src/inverse_dynamics\.c"):
        write_package(tmp_path, FILES)


def test_another_programs_manifest_is_foreign(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text('{"name": "web app"}')
    with pytest.raises(InputError, match=r"psdmc did not write the files in this folder: manifest\.json"):
        write_package(tmp_path, FILES)


def test_a_forged_manifest_cannot_reach_out_of_its_folder(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("keep")
    forged = {
        "generator": "psdmc",
        "files": {"../victim": digest("keep"), str(victim): digest("keep")},
    }
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "manifest.json").write_text(json.dumps(forged))
    write_package(tmp_path / "arm", FILES, force=True)
    assert victim.read_text() == "keep"


def test_a_forged_manifest_below_a_link_deletes_nothing(tmp_path: Path) -> None:
    """`src` leads to another folder of the user's; the manifest lists a file there with its true digest."""
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "x.c").write_text("keep")
    arm = tmp_path / "arm"
    arm.mkdir()
    (arm / "src").symlink_to(outside)
    forged = {"generator": "psdmc", "files": {"src/x.c": digest("keep")}}
    (arm / "manifest.json").write_text(json.dumps(forged))

    for force in (False, True):
        with pytest.raises(InputError, match="it is a symbolic link"):
            write_package(arm, FILES, force=force)

    assert _stamps(outside).keys() == {"x.c"}, "psdmc wrote or deleted through a link"
    top = {path: text for path, text in FILES.items() if not path.startswith("src/")}
    write_package(arm, top, force=True)
    assert (outside / "x.c").read_text() == "keep"


def test_only_names_that_psdmc_gives_are_deleted(tmp_path: Path) -> None:
    theirs = ["notes.txt", ".git/config", "src/deep/x.c", "Makefile.am", "build/arm.so", "manifest.json.c"]
    for name in theirs:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("keep")
    forged = {"generator": "psdmc", "files": {name: digest("keep") for name in theirs}}
    (tmp_path / "manifest.json").write_text(json.dumps(forged))

    write_package(tmp_path, FILES, force=True)

    assert all((tmp_path / name).read_text() == "keep" for name in theirs)


def test_every_name_of_a_package_is_one_that_psdmc_gives() -> None:
    for path in FILES:
        assert path == "manifest.json" or OWN_NAME.fullmatch(path), path


def test_what_is_no_file_is_foreign(tmp_path: Path) -> None:
    (tmp_path / "src" / "tables.c").mkdir(parents=True)
    os.mkfifo(tmp_path / "Makefile")
    (tmp_path / "manifest.json").write_text('{"generator": "psdmc", "files": {"LICENSE": "0"}}')
    for force in (False, True):
        with pytest.raises(InputError, match=r"not overwriting src/tables\.c, Makefile"):
            write_package(tmp_path, FILES, force=force)
    assert (tmp_path / "src" / "tables.c").is_dir()
    assert stat.S_ISFIFO((tmp_path / "Makefile").stat().st_mode)


OTHER = package_files(pendulum(pendulum_info(joint="elbow"), options=EmitOptions(real="float32")))


def killed_at(operation: int, folder: Path, files: dict[str, str]) -> bool:
    """Write a package in a process that is killed before that file operation; whether it came that far."""
    child = os.fork()
    if child == 0:
        count = 0

        def counted(call):
            def step(*given, **named):
                nonlocal count
                count += 1
                if count == operation:
                    os.kill(os.getpid(), signal.SIGKILL)
                return call(*given, **named)

            return step

        for name in ("open", "replace", "unlink", "fsync", "mkdir"):
            setattr(os, name, counted(getattr(os, name)))
        try:
            write_package(folder, files)
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0


@pytest.mark.parametrize(
    "before",
    [pytest.param({}, id="empty", marks=pytest.mark.slow), pytest.param(FILES, id="another package")],
)
def test_an_emission_killed_at_any_step_is_not_blamed_on_the_user(
    before: dict[str, str], tmp_path: Path
) -> None:
    """Every file is old or new, and the next emission, of whatever, ends in its own files alone."""
    killed = 0
    for operation in range(1, 2000, 7):
        folder = tmp_path / str(operation)
        if before:
            write_package(folder, before)
        was_killed = killed_at(operation, folder, OTHER)
        for path in OTHER:
            if (folder / path).exists():
                assert (folder / path).read_text() in (before.get(path), OTHER[path]), path
        after = FILES if operation % 2 else OTHER
        write_package(folder, after)
        assert {name: (folder / name).read_text() for name in _stamps(folder)} == after
        if not was_killed:
            break
        killed += 1
    assert killed > 10


def test_a_full_disk_leaves_the_old_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_package(tmp_path, FILES)
    calls = []

    def full(handle: int) -> None:
        calls.append(handle)
        if len(calls) > 5:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("psdmc.files.os.fsync", full)
    with pytest.raises(ToolchainError, match="No space left") as caught:
        write_package(tmp_path, OTHER)
    assert "\n" not in caught.value.message
    assert {name: (tmp_path / name).read_text() for name in _stamps(tmp_path)} == FILES

    calls.clear()
    with pytest.raises(ToolchainError, match="No space left"):
        write_package(tmp_path / "new", OTHER)
    assert not (tmp_path / "new").exists()
    monkeypatch.undo()
    write_package(tmp_path / "new", OTHER)
    assert {name: (tmp_path / "new" / name).read_text() for name in _stamps(tmp_path / "new")} == OTHER


def test_edited_files_are_known(tmp_path: Path) -> None:
    assert edited_files(tmp_path) is None
    write_package(tmp_path, FILES)
    assert edited_files(tmp_path) == []

    (tmp_path / "src" / "tables.c").write_text("edited")
    (tmp_path / "README.md").unlink()
    assert sorted(edited_files(tmp_path)) == ["README.md", "src/tables.c"]


def test_a_folder_that_cannot_be_made_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written") as caught:
        write_package(tmp_path / "file" / "arm", FILES)
    assert "\n" not in caught.value.message
    assert "place" in str(caught.value.hint)


def test_an_interrupted_write_leaves_the_old_file_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_package(tmp_path, FILES)
    other = package_files(pendulum(pendulum_info(joint="elbow")))

    def interrupted(source: str, target: object) -> None:
        raise OSError(28, "No space left on device", str(target))

    monkeypatch.setattr("psdmc.files.os.replace", interrupted)
    with pytest.raises(ToolchainError, match="No space left"):
        write_package(tmp_path, other)
    assert {path: (tmp_path / path).read_text() for path in FILES} == FILES
    assert set(_stamps(tmp_path)) == set(FILES), "a temporary file stays behind"
