"""Write, or with --check compare, what is made from the table of registers: RTL package, C header and README."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from openecho import registers
from openecho.hardware import ROOT, RTL
from scripts.readme import README, replaced

PACKAGE = RTL / "axi" / "openecho_registers_pkg.sv"
HEADER = RTL / "axi" / "openecho_registers.h"


def made() -> Iterator[tuple[Path, str]]:
    """Files, and what must be in them.

    Raises
    ------
    ValueError
        If the README lacks its markers.
    """
    yield PACKAGE, registers.systemverilog()
    yield HEADER, registers.c_header()
    yield README, replaced(README.read_text(), "registers", registers.markdown())


def main(arguments: list[str] | None = None) -> int:
    """Return 0, 1 if a file differs, 2 if it can't be told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="fail if a file is not what it would be written as")
    check = parser.parse_args(arguments).check
    try:
        for path, text in made():
            if not check:
                path.write_text(text)
            elif not path.exists() or path.read_text() != text:
                found = "nothing" if not path.exists() else "something else"
                name = path.relative_to(ROOT)
                print(f"error: {name}: found {found}, expected what scripts/registers.py writes", file=sys.stderr)
                return 1
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
