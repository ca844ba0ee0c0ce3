"""The process as its surroundings meet it: Ctrl-C, closed and full outputs, poor locales, no home, no network."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bundled import robot_path
from command_line import files_in, started, status
from slow_cases import slow_but_for

from psdmc.toolchain.cache_room import is_sound

PSDMC = [sys.executable, "-m", "psdmc"]
SCARA = str(robot_path("scara"))
TWO_LINK_MODEL = str(Path(__file__).parent.parent / "golden" / "two_link" / "two_link.npz")
"""A model file of psdmc 0.1: it still loads."""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "scara.npz"
    assert status("derive", SCARA, "-o", path) == 0
    return path


def lines(said: str) -> list[str]:
    return [line.split(":")[0] for line in said.splitlines()]


# Ctrl-C

INTERRUPTED = "error: interrupted\n"
LOADING = [["derive", SCARA], ["calibrate", "m.npz", "log.csv", "-o", "x.npz"]]


@pytest.mark.parametrize("command", slow_but_for(LOADING[:1], LOADING))
def test_ctrl_c_while_modules_load_is_one_line(command: list[str], tmp_path: Path):
    """Sent as soon as psdmc's own first module is there, and ever later: Python's own start cannot be helped."""
    seen = set()
    for delay in (0.0, 0.05, 0.1, 0.2, 0.4):
        words = [sys.executable, "-X", "importtime", "-m", "psdmc", *command]
        with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
            said = ""
            while "psdmc.cli.boundary" not in said:
                said = process.stderr.readline()
            process.stderr.readline()
            time.sleep(0.02 + delay)
            process.send_signal(signal.SIGINT)
            rest = process.stderr.read()
        words_said = [line for line in rest.splitlines() if "import time:" not in line]
        seen.add(process.returncode)
        if process.returncode == 130:
            assert words_said == [INTERRUPTED.strip()], rest
        assert "Traceback" not in rest
    assert 130 in seen


def test_ctrl_c_while_a_command_loads_a_module_is_one_line(tmp_path: Path):
    """As NumPy's compiled parts do, the module puts an error of its own in the place of whatever it meets."""
    (tmp_path / "swallowing.py").write_text(
        "import signal\ntry:\n    signal.raise_signal(signal.SIGINT)\nexcept BaseException:\n    raise ImportError\n"
    )
    code = "from psdmc.cli.boundary import as_error\nwith as_error():\n    import swallowing"
    ended = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    assert (ended.returncode, ended.stderr) == (130, INTERRUPTED)


def test_ctrl_c_while_it_works_is_one_line(model: Path, tmp_path: Path):
    """The compiler hangs; Ctrl-C reaches the whole group, as a terminal sends it."""
    hanging = tmp_path / "cc"
    hanging.write_text(
        f'#!/bin/sh\ncase "$*" in *"-c src"*) touch {tmp_path}/started; sleep 60;; esac\nexec gcc "$@"\n'
    )
    hanging.chmod(0o755)
    environment = os.environ | {"CC": str(hanging), "PSDMC_CACHE_DIR": str(tmp_path / "cache")}
    code = f"import psdmc; psdmc.compile(psdmc.load({str(model)!r}), functions=['gravity'])"
    main = f"from psdmc.cli import main; from psdmc.cli import commands\n@commands.app.command()\ndef work():\n    {code}\n"
    process = subprocess.Popen(
        [sys.executable, "-c", main + "main(['work'])"],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while not (tmp_path / "started").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    said = process.communicate(timeout=30)[1]

    assert said == INTERRUPTED
    assert process.returncode == 130
    assert all(is_sound(entry) for entry in (tmp_path / "cache").iterdir()), "half an entry stays behind"
    assert not list((tmp_path / "cache").rglob("library.so"))


def test_ctrl_c_is_ignored_where_the_shell_says_so(tmp_path: Path):
    """As under nohup, or behind `&` in a script."""
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "from psdmc.cli.boundary import as_error\n"
        "with as_error(): signal.raise_signal(signal.SIGINT); print('on')"
    )
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        == "on\n"
    )


# outputs


BUFFERED = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
"""What a new user's shell has: Python buffers its output there."""


def into(target: str, *words: object, **more: str) -> subprocess.CompletedProcess[str]:
    with open(target, "w", encoding="utf-8") as stream:
        return subprocess.run(
            [*PSDMC, *map(str, words)],
            stdout=stream,
            stderr=subprocess.PIPE,
            text=True,
            env=BUFFERED | more,
            check=False,
        )


WRITING = [["show"], ["show", "--terms"], ["check"]]


@pytest.mark.parametrize("words", slow_but_for(WRITING[:2], WRITING))
def test_a_full_output_is_one_line(words: list[str], model: Path):
    done = into("/dev/full", words[0], model, *words[1:])
    assert done.stderr == "error: standard output: No space left on device\n"
    assert done.returncode == 4


@pytest.mark.parametrize("words", slow_but_for(WRITING[:2], WRITING))
def test_a_closed_output_is_no_error(words: list[str], model: Path):
    with subprocess.Popen(
        [*PSDMC, words[0], str(model), *words[1:]],
        env=BUFFERED,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 1


@pytest.fixture(scope="module")
def package(model: Path) -> Path:
    folder = model.parent / "package"
    assert status("emit-c", model, "-o", folder, "--functions", "gravity") == 0
    return folder


PRINTING = [
    ["--version"],
    ["--help"],
    ["show", "MODEL", "--json"],
    ["derive", SCARA, "-o", "derived.npz"],
    ["emit-c", "MODEL", "-o", "emitted", "--functions", "gravity"],
    ["build", "PACKAGE"],
    ["check", "MODEL"],
    ["doctor"],
    ["cache"],
    ["new", "new.toml"],
]
SAID_ALWAYS = ("next: ", "note: ", "warning: ")


@pytest.mark.parametrize("words", slow_but_for([PRINTING[0], PRINTING[3]], PRINTING))
@pytest.mark.parametrize("closed", [">&-", "| true"])
def test_every_command_ends_quietly_with_a_closed_output(
    words: list[str], closed: str, model: Path, package: Path, tmp_path: Path
):
    """Closed before the start, the work is done; closed by its reader meanwhile, the status says that lines are missing."""
    named = [{"MODEL": str(model), "PACKAGE": str(package)}.get(word, word) for word in words]
    command = f"{{ {shlex.join([*PSDMC, *named])}; echo $? > status; }} {closed}"
    own = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        command, shell=True, cwd=tmp_path, env=own, stderr=subprocess.PIPE, text=True, check=False
    )

    assert [line for line in done.stderr.splitlines() if not line.startswith(SAID_ALWAYS)] == []
    assert (tmp_path / "status").read_text().strip() in (("0",) if closed == ">&-" else ("0", "1"))


def test_a_closed_error_output_is_no_traceback(tmp_path: Path):
    done = subprocess.run(
        f"{sys.executable} -m psdmc derive no.urdf 2>&-",
        shell=True,
        capture_output=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == b""


# text


TERMINALS = [
    {"LC_ALL": "C"},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"PYTHONIOENCODING": "ascii"},
    {"PYTHONIOENCODING": "latin-1"},
]


@pytest.mark.parametrize("environment", slow_but_for(TERMINALS[1:2], TERMINALS), ids=str)
def test_any_name_on_any_terminal(environment: dict[str, str], tmp_path: Path):
    text = robot_path("scara").read_text(encoding="utf-8")
    named = text.replace('name = "J1"', 'name = "Gelenk_ü_関節"')
    folder = tmp_path / "Röboter 関節"
    folder.mkdir()
    (folder / "arm ü.toml").write_text(named, encoding="utf-8")

    derived = started("derive", folder / "arm ü.toml", "-o", folder / "m ü.npz", **environment)
    shown = started("show", folder / "m ü.npz", **environment)
    missing = started("show", folder / "no ü.npz", **environment)

    assert (derived.returncode, shown.returncode, missing.returncode) == (0, 0, 2), derived.stderr
    assert "Gelenk_" in shown.stdout
    for done in (derived, shown, missing):
        assert "Traceback" not in done.stderr
    assert lines(missing.stderr) == ["error", "hint"]


def test_a_package_is_built_in_a_folder_with_spaces_and_letters(model: Path, tmp_path: Path):
    folder = tmp_path / "mein Röboter 関節"
    assert status("emit-c", model, "-o", folder, "--functions", "gravity") == 0
    assert status("build", folder) == 0


# surroundings


def test_derive_writes_nothing_to_a_home_and_says_nothing_of_it(tmp_path: Path):
    (tmp_path / "home").write_text("no folder")
    surroundings = {
        "HOME": str(tmp_path / "home"),
        "XDG_CACHE_HOME": "",
        "XDG_CONFIG_HOME": "",
        "MPLCONFIGDIR": "",
    }
    done = started("derive", SCARA, "-o", tmp_path / "m.npz", **surroundings)

    assert done.returncode == 0
    assert done.stderr == f"next: psdmc check {tmp_path / 'm.npz'}\n"


def test_pictures_are_drawn_without_a_home_and_without_a_word(tmp_path: Path):
    (tmp_path / "home").write_text("no folder")
    code = (
        "from psdmc.report.drawing import svg\n"
        "print(svg(lambda figure: figure.subplots().plot([1, 2]), (3.0, 2.0), 'a line')[:4])"
    )
    surroundings = {
        "HOME": str(tmp_path / "home"),
        "XDG_CACHE_HOME": "",
        "XDG_CONFIG_HOME": "",
        "MPLCONFIGDIR": "",
    }
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env=os.environ | surroundings,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("<svg\n", "")


BESIDE = ("matplotlib", "psdmc.calibration.calibrate", "psdmc.bench.run", "psdmc.report")
"""What commands beside the pipeline are made of."""

DEFAULTS = {
    "psdmc.bench",
    *("psdmc.calibration", "psdmc.calibration.motions", "psdmc.calibration.motions.excite_options"),
}
"""Of which the command line loads what its help says."""


@pytest.mark.parametrize(
    ("words", "absent"),
    [
        (["--version"], ("numpy", "scipy", "pinocchio", "jinja2", "rich", *BESIDE)),
        (["derive", SCARA, "-o", "m.npz"], ("matplotlib", "scipy.signal", "scipy.stats", *BESIDE)),
        (["show", TWO_LINK_MODEL], ("scipy", "pinocchio", "jinja2", *BESIDE)),
        (["emit-c", TWO_LINK_MODEL, "-o", "c"], ("scipy", "pinocchio", "rich", *BESIDE)),
        (["--help"], ("matplotlib",)),
    ],
)
def test_a_command_loads_what_it_needs(words: list[str], absent: tuple[str, ...], tmp_path: Path):
    code = (
        "import sys\nfrom psdmc.cli import main\n"
        f"try: main({words!r})\nexcept SystemExit: pass\n"
        "print('loaded:', *sys.modules, file=sys.stderr)"
    )
    own = os.environ | {"PSDMC_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=True, env=own
    )
    loaded = done.stderr.split("loaded:")[1].split()
    assert not set(absent) & set(loaded)
    beside = [name for name in loaded if name.startswith(("psdmc.bench", "psdmc.calibration"))]
    assert set(beside) <= DEFAULTS


def test_names_of_the_package_are_loaded_when_used():
    """And the function `derive` is there, whatever was imported from the folder of that name before."""
    code = (
        "import sys, psdmc\n"
        "assert 'numpy' not in sys.modules\n"
        "assert set(psdmc.__all__) <= set(dir(psdmc))\n"
        "import psdmc.derivation.derive\n"
        "assert callable(psdmc.derive) and callable(psdmc.compile) and psdmc.InputError.exit_status == 2\n"
        "from psdmc import *\n"
        "assert derive is psdmc.derive and load is psdmc.load\n"
        "assert not hasattr(psdmc, 'nothing')"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# places


def test_an_output_that_is_the_input(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "robot.toml").write_bytes(Path(SCARA).read_bytes())
    (tmp_path / "m.npz").write_bytes(model.read_bytes())
    (tmp_path / "link.npz").symlink_to("m.npz")
    before = files_in(tmp_path)
    with_report = ("calibrate", tmp_path / "m.npz", "log.csv", "-o", tmp_path / "x.npz", "--report")
    for words in (
        ("derive", tmp_path / "robot.toml", "-o", tmp_path / "robot.toml"),
        ("calibrate", tmp_path / "m.npz", tmp_path / "log.csv", "-o", tmp_path / "m.npz"),
        ("calibrate", tmp_path / "m.npz", tmp_path / "log.csv", "-o", tmp_path / "link.npz"),
        (*with_report, tmp_path / "m.npz"),
        (*with_report, tmp_path / "x.json"),
        ("bench", tmp_path / "m.npz", "--json", tmp_path / "m.npz"),
        ("bench", tmp_path / "m.npz", "--json", tmp_path / "x", "--report", tmp_path / "x"),
    ):
        assert status(*words) == 2, words
        assert lines(capsys.readouterr().err) == ["error", "hint"], words
    assert files_in(tmp_path) == before


@pytest.mark.parametrize("place", ["absent/x", "file/x", "folder"])
def test_a_wrong_place_is_said_before_the_work(
    place: str, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    where = tmp_path / place
    for words in (
        ("derive", SCARA, "-o", where),
        ("calibrate", model, tmp_path / "no.csv", "-o", where),
        ("bench", model, "--json", where),
        ("bench", model, "--report", where),
    ):
        assert status(*words) == 2, words
        said = capsys.readouterr().err
        assert lines(said) == ["error", "hint"], words
        assert "cannot be written" in said, words
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


def test_a_folder_where_a_file_is_expected(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for words in (
        ("derive", tmp_path),
        ("show", tmp_path),
        ("check", tmp_path),
        ("emit-c", tmp_path, "-o", "x"),
    ):
        assert status(*words) == 2, words
        assert lines(capsys.readouterr().err) == ["error", "hint"], words


def test_a_file_where_a_folder_is_expected(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for words in (("emit-c", model, "-o", model, "--functions", "gravity"), ("build", model)):
        assert status(*words) == 2, words
        assert lines(capsys.readouterr().err) == ["error", "hint"], words


# the cache, as a user sees it


def test_the_cache_is_shown_and_cleared(tmp_path: Path):
    place = {"PSDMC_CACHE_DIR": str(tmp_path / "my cache"), "PSDMC_DIRECT_CALLS": "0"}
    assert started("cache", **place).stdout == f"{tmp_path / 'my cache'}: 0 entries, 0.0 MiB of 1024.0 MiB\n"

    code = f"import psdmc; psdmc.compile(psdmc.derive({SCARA!r}), functions=['gravity'])"
    subprocess.run([sys.executable, "-c", code], env=os.environ | place, check=True)
    assert ": 3 entries, " in started("cache", **place).stdout, "a lowering, a library and its interface"
    assert started("cache", "--clear", **place).stdout.splitlines()[0] == "3 entries removed"
    assert list((tmp_path / "my cache").iterdir()) == []


# no network

NO_NETWORK = """
import socket, sys

class Refused(socket.socket):
    def __init__(self, *given, **named):
        raise AssertionError("psdmc opened a socket")

socket.socket = Refused
socket.create_connection = socket.getaddrinfo = Refused

import numpy as np
import psdmc
from psdmc.verification.check import check_model

model = psdmc.derive(sys.argv[1])
model.save("m.npz")
model = psdmc.load("m.npz")
psdmc.emit_c(model, "c", functions=["inverse_dynamics"])
robot = psdmc.compile(model, functions=["inverse_dynamics"])
zero = np.zeros(model.n)
assert np.isfinite(robot.inverse_dynamics(zero, zero, zero)).all()
assert all(row.passed for row in check_model(model))
import psdmc.cli.commands, psdmc.report.calibrate_demo
print("done")
"""


def test_psdmc_needs_no_network(tmp_path: Path):
    surroundings = os.environ | {"PSDMC_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", NO_NETWORK, SCARA],
        cwd=tmp_path,
        env=surroundings,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "done\n", done.stderr
