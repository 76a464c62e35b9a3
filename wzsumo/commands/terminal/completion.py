"""The script with which a shell completes commands, options, names of the library and file names."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from wzsumo.scenario.library import NETWORKS, STUDIES, ZONES, library_files

SHELLS = ("bash", "zsh", "tcsh")


def completion_option(whole_parser: Callable[[], argparse.ArgumentParser]) -> type[argparse.Action]:
    """An option that prints the script for a shell and exits; `whole_parser` gives the parser of every command."""

    class PrintCompletion(argparse.Action):
        def __call__(self, _parser: Any, _namespace: Any, values: Any, _option_string: Any = None) -> NoReturn:
            sys.stdout.write(completion_script(whole_parser(), shell=str(values)) + "\n")
            sys.exit(0)

    return PrintCompletion


def completion_script(parser: argparse.ArgumentParser, *, shell: str) -> str:
    """The script for a shell. Paths are completed by files or folders, a zone by the names of the library."""
    import shtab

    # argparse has no public way to the actions of a parser; shtab goes the same.
    commands = next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    for sub in commands.choices.values():
        for action in sub._actions:
            if action.dest == "zone" and not action.option_strings:
                action.choices = list(library_files(ZONES, NETWORKS, STUDIES))
            elif action.type is Path:
                action.complete = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE
    return shtab.complete(parser, shell=shell)
