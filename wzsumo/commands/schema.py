"""The command `schema`: the JSON Schema of spec files, and the reference of their keys."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from wzsumo.files.output import write_whole
from wzsumo.scenario.keys import json_schema
from wzsumo.scenario.keys_page import keys_page
from wzsumo.scenario.scenario import Scenario
from wzsumo.spec import Spec
from wzsumo.sweep.study_file import StudySpec

KINDS: dict[str, type[Spec]] = {"scenario": Scenario, "study": StudySpec}
MORE = """\
Editors that know TOML (taplo, Even Better TOML in VS Code) then complete keys and check values as you type. The first line of a
scenario names the schema that lies beside it:

  #:schema ./scenario.schema.json

  wzsumo schema --out scenario.schema.json
  wzsumo schema study --out study.schema.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("kind", nargs="?", choices=list(KINDS), default="scenario", help="of which files (default: scenario)")
    parser.add_argument(
        "--markdown", action="store_true", help="the same as a page to read: every key, its default, its source"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="the file to write (default: print it)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """The schema, after writing it where a file is named."""
    schema = json_schema(KINDS[args.kind])
    if args.out is None:
        return schema
    write_whole(args.out, _text(schema, args).encode())
    return {"file": str(args.out), "kind": args.kind}


def tell(figures: dict[str, Any], args: argparse.Namespace) -> None:
    """Print the schema, or where it lies."""
    sys.stdout.write(_text(figures, args) if args.out is None else f"{args.out}\n")


def _text(schema: dict[str, Any], args: argparse.Namespace) -> str:
    if args.markdown:
        return keys_page(KINDS[args.kind], title=f"Keys of a {args.kind}")
    return json.dumps(schema, indent=1) + "\n"
