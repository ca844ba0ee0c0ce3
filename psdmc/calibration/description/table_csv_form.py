"""`[csv]`: the form of text tables, where it cannot be told from the file."""

from __future__ import annotations

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.logs.log_format import TextForm
from psdmc.calibration.logs.toml_tables import TomlTable, shown

SEPARATOR_WORDS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
MOST_SKIPPED = 10_000


def _read(value: object, reading: Reading) -> TextForm:
    table = TomlTable(value, "csv", ("separator", "header", "skip"), reading.faults)
    header = table.content.get("header")
    if header is not None and not isinstance(header, bool):
        reading.faults.append(f"csv: header: found {shown(header)}, expected true or false")
        header = None
    word = table.word("separator", tuple(SEPARATOR_WORDS), "") if table.has("separator") else ""
    return TextForm(
        separator=SEPARATOR_WORDS.get(word),
        header=header,
        skip=table.whole("skip", 0, MOST_SKIPPED, 0),
    )


CSV_FORM: Table[TextForm] = Table("csv", _read, TextForm())
