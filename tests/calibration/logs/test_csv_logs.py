"""CSV as loggers and spreadsheets write it: read right, or refused with line and column."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.logs.formats.text import FORMAT
from psdmc.calibration.logs.log_files import read_log
from psdmc.errors import InputError


def names_of(data: bytes) -> list[str]:
    return FORMAT.pieces(io.BytesIO(data), "run.csv")[0]


HEADER = "time_s,position_rad.a,current_a.a"
ROWS = [[0.0, 1.5, -2.25], [0.5, 1.25, 3.0]]


def text(separator: str = ",", point: str = ".", header: str = HEADER) -> str:
    lines = [header.replace(",", separator)]
    lines += [separator.join(str(x).replace(".", point) for x in row) for row in ROWS]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    "data",
    [
        text().encode(),
        b"\xef\xbb\xbf" + text().encode(),
        text().replace("\n", "\r\n").encode(),
        text().replace("\n", "\r").encode(),
        ("\n\n" + text()).encode(),
        text().rstrip("\n").encode(),
        text(";").encode(),
        text("\t").encode(),
        text(";", ",").encode(),
        text("\t", ",").encode(),
        text(" ").encode(),
        text(" ", ",").replace(" ", "   ").encode(),
        text(" ").replace("\n", " \n").encode(),
        text(" ", header='"time_s","position_rad.a","current_a.a"').encode(),
        text(header='"time_s","position_rad.a","current_a.a"').encode(),
        text(", ").encode(),
        b'time_s,position_rad.a,current_a.a\n"0.0","1.5","-2.25"\n"0.5","1.25","3e0"\n',
    ],
    ids=[
        "plain", "mark", "windows", "mac", "blank lines", "no last newline", "semicolons", "tabs",
        "decimal commas", "decimal commas and tabs", "spaces", "decimal commas and many spaces", "spaces at ends",
        "quoted names between spaces", "quoted names", "commas and spaces", "quoted numbers",
    ],
)  # fmt: skip
def test_common_dialects_are_read(tmp_path: Path, data: bytes):
    path = tmp_path / "run.csv"
    path.write_bytes(data)

    log = read_log(path)

    assert log.joint_names == ("a",)
    assert np.column_stack([log.time, log.position, log.effort]).tolist() == ROWS


def test_a_quoted_name_may_hold_the_separator():
    assert names_of(b'time_s,"position_rad.a,b"\n1,2\n') == ["time_s", "position_rad.a,b"]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\xff\xfe" + text().encode("utf-16-le"), "is UTF-16 text, expected UTF-8"),
        (text().encode("utf-16-be"), "binary data or UTF-16"),
        (b"\xff\xfe\x00\x00" + text().encode("utf-32-le"), "is UTF-32 text"),
        (text().encode() + b"1,\xe9,2\n", "line 4: byte 0xe9 is no UTF-8"),
        (b"\xef\xbb\xbf" + text().encode() + b"1,\xe9,2\n", "line 4: byte 0xe9 is no UTF-8"),
        (b"PK\x03\x04\x00\x00", "binary data"),
        (b"\n\n", "holds no table"),
        (HEADER.encode(), "no rows under its header"),
        (HEADER.encode() + b"\n\n\n", "no rows under its header"),
        (b"0,1,2\n1,2,3\n", "no header: its first line holds numbers"),
        (b"time_s,,current_a.a\n1,2,3\n", "column 2 of 3 has no name"),
        (b"time_s,position_rad.a,\n1,2,\n", "column 3 of 3 has no name"),
        (b"time_s,position_rad.a,time_s\n1,2,3\n", "named twice: 'time_s'"),
        (HEADER.encode() + b"\n0,1,2\n1,zero,2\n", "line 3, column 'position_rad.a': 'zero' is no number"),
        (HEADER.encode() + b"\n0,1,2\n\n1,,2\n", "line 4, column 'position_rad.a': the cell is empty"),
        (HEADER.encode() + b"\n0,1,2\n1,2\n", "line 3 has 2 cells under 3 names"),
        (HEADER.encode() + b"\n0,1,2,3\n1,2,3,4\n", "line 2 has 4 cells under 3 names"),
        (HEADER.encode() + "\n0,٣,2\n".encode(), "line 2, column 'position_rad.a': '٣' is no number"),
        (HEADER.encode() + b"\n0,1_000,2\n", "'1_000' is no number"),
        (HEADER.encode() + b'\n0,"1,5",2\n', "'1,5' is no number"),
        (HEADER.encode() + b"\n0,0x10,2\n", "'0x10' is no number"),
        (text(";").encode() + b"1.234,5;1;2\n", "numbers with both ',' and '.'"),
        (b"time_s," + b"x" * 200_000 + b"\n1,2\n", "not a header, or damaged"),
        (",".join(f"c{k}" for k in range(1001)).encode() + b"\n1\n", "1,001 columns, expected at most 1,000"),
        (text(" ").encode() + b"1 zero 2\n", "line 4, column 'position_rad.a': 'zero' is no number"),
        (text(" ").encode() + b"1 2\n", "line 4 has 2 cells under 3 names"),
        (b"my time;my angle\n1;2\n", "no column 'time_s'"),
        (b"time_s,position_rad.a\x01\n1,2\n", "control characters in the name of column"),
    ],
)
def test_what_cannot_be_read_is_refused_by_line_and_column(tmp_path: Path, data: bytes, message: str):
    path = tmp_path / "run.csv"
    path.write_bytes(data)

    with pytest.raises(InputError) as raised:
        read_log(path)

    assert message in raised.value.message
    assert "run.csv" in raised.value.message
    assert len(raised.value.message) < 400


@pytest.mark.parametrize(
    ("rows", "remedy"), [(b"0,1,2\n1,2", "delete this line"), (b"0,1\n1,2,3", "one cell per")]
)
def test_a_file_that_ends_within_a_line_gets_its_remedy(rows: bytes, remedy: str):
    with pytest.raises(InputError) as raised:
        list(FORMAT.pieces(io.BytesIO(HEADER.encode() + b"\n" + rows), "run.csv")[1])

    assert remedy in (raised.value.hint or "")


def test_decimal_commas_under_commas_get_their_remedy():
    with pytest.raises(InputError) as raised:
        list(FORMAT.pieces(io.BytesIO(HEADER.encode() + b'\n0,"1,5",2\n'), "run.csv")[1])

    assert "';', tab or spaces" in (raised.value.hint or "")


def test_columns_by_other_names_are_told_of_descriptions(tmp_path: Path):
    """As UR's recorder writes them: separated by spaces."""
    (tmp_path / "ur.csv").write_text("timestamp actual_q_0 actual_current_0\n0.0 1.0 2.0\n", encoding="utf-8")

    with pytest.raises(InputError, match="no column 'time_s'") as raised:
        read_log(tmp_path / "ur.csv")

    assert "it has 'timestamp', 'actual_q_0', 'actual_current_0'" in (raised.value.hint or "")
    assert "psdmc calibrate --describe MODEL.npz LOG" in (raised.value.hint or "")


def test_spaces_within_names_separate_nothing_where_another_mark_does():
    assert names_of(b"time_s;my other angle;x\n1;2;3\n") == ["time_s", "my other angle", "x"]
