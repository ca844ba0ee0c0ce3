"""What this machine's C and POSIX headers declare or define: the oracle of psdmc/backends/c/reserved/c_and_posix.txt.

Run as a program it rewrites that file with what it holds and what this machine adds, sorted.
"""

from __future__ import annotations

import re
import subprocess
import textwrap
from pathlib import Path

LIST = Path(__file__).parents[3] / "psdmc" / "backends" / "c" / "reserved" / "c_and_posix.txt"

C_HEADERS = """assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg
stdatomic stdbool stddef stdint stdio stdlib stdnoreturn string threads time uchar wchar wctype"""
POSIX_HEADERS = """aio alloca arpa/inet byteswap cpio dirent dlfcn endian fcntl fmtmsg fnmatch ftw getopt glob grp
iconv langinfo libgen malloc monetary mqueue ndbm net/if netdb netinet/in netinet/tcp nl_types poll pthread pwd regex
sched search semaphore spawn strings stropts sys/ioctl sys/ipc sys/mman sys/msg sys/param sys/resource sys/select
sys/sem sys/shm sys/socket sys/stat sys/statvfs sys/sysmacros sys/time sys/times sys/types sys/uio sys/un sys/utsname
sys/wait syslog tar termios trace ulimit unistd utime utmpx wordexp"""
NOT_IN_CPP = ("stdatomic", "stdnoreturn", "threads")
"""C11 headers that C++17 compilers do not take."""

DECLARED = "Function|Var|Typedef|Record|CXXRecord|Enum|EnumConstant|Namespace"
DECLARATION = re.compile(rf"(?:[|`]-|[| ] [|`]-)(?:{DECLARED})Decl 0x\w+ (.*)")
"""A declaration at file scope, or one level below: in extern "C", or an enumeration's constant."""


def sources() -> dict[str, str]:
    """Language -> a C file that includes everything, with all extensions: g++ has them on without being asked."""
    names = [*C_HEADERS.split(), *POSIX_HEADERS.split()]

    def including(kept: list[str]) -> str:
        lines = [f"#if __has_include(<{name}.h>)\n#include <{name}.h>\n#endif\n" for name in kept]
        return "#ifndef _GNU_SOURCE\n#define _GNU_SOURCE 1\n#endif\n" + "".join(lines)

    return {"c": including(names), "c++": including([name for name in names if name not in NOT_IN_CPP])}


def macros(compiler: str, language: str) -> set[str]:
    """Names that the headers, or the compiler itself, define as macros."""
    done = subprocess.run(
        [compiler, f"-x{language}", "-dM", "-E", "-"],
        input=sources()[language],
        text=True,
        capture_output=True,
        check=True,
    )
    return _usable(re.findall(r"^#define (\w+)", done.stdout, re.MULTILINE))


def declarations(language: str) -> set[str]:
    """Functions, variables, types, tags and constants of the headers, as clang parses them."""
    words = ["clang", f"-x{language}", "-fsyntax-only", "-Xclang", "-ast-dump", "-fno-color-diagnostics", "-"]
    done = subprocess.run(words, input=sources()[language], text=True, capture_output=True, check=True)
    found = []
    for line in done.stdout.splitlines():
        matched = DECLARATION.match(line)
        if matched:
            found.append(_declared_name(matched[1]))
    return _usable(name for name in found if name)


def _declared_name(rest: str) -> str | None:
    """The name in what follows a declaration's address: `prev 0x... <where> where used NAME 'type' ...`."""
    rest = re.sub(r"<(?:[^<>]|<[^<>]*>)*>", "", re.sub(r"(?:prev|parent) 0x\w+ ", "", rest), count=1)
    before_type = rest.split(" '")[0]
    words = [word for word in before_type.split() if re.fullmatch(r"[A-Za-z_]\w*", word)]
    words = [word for word in words if word not in ("definition", "extern", "static", "inline", "implicit")]
    is_tag_only = not words or words[-1] in ("struct", "union", "enum", "used", "referenced")
    return None if is_tag_only else words[-1]


def _usable(names: object) -> set[str]:
    """Those that psdmc could take for a robot: it never makes identifiers with outer or double underscores."""
    return {name for name in names if re.fullmatch(r"[A-Za-z]\w*", name) and "__" not in name.rstrip("_")}  # type: ignore[attr-defined]


def main() -> None:
    found = set(LIST.read_text(encoding="ascii").split()) if LIST.is_file() else set()
    for language, compilers in (("c", ("gcc", "clang")), ("c++", ("g++", "clang++"))):
        found |= declarations(language)
        for compiler in compilers:
            found |= macros(compiler, language)
    text = textwrap.fill(" ".join(sorted(found)), 118, break_long_words=False, break_on_hyphens=False)
    LIST.write_text(text + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
