"""Commands in processes that part from this one, which has loaded all their modules."""

import contextlib
import io
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

NOWHERE = Path(os.devnull)


def load_commands() -> None:
    """Load everything that commands load, once, before the processes part."""
    import wzsumo.commands.export
    import wzsumo.commands.init
    import wzsumo.commands.layout
    import wzsumo.commands.live
    import wzsumo.commands.map
    import wzsumo.commands.place
    import wzsumo.commands.report
    import wzsumo.commands.run
    import wzsumo.commands.sweep  # noqa: F401 - loaded for the processes, not used here


def started(
    words: list[str], *, said: int, given: Path = NOWHERE, printed: Path = NOWHERE, prepare: Callable[[], None] = lambda: None
) -> int:
    """The number of a process, of a session of its own, that runs a command; `prepare` is called in it first.

    Its stderr is the descriptor `said`, with the traceback of what no command should raise; its stdin is read from the file
    `given`, its stdout written to `printed`.
    """
    from wzsumo.cli import main as wzsumo

    child = os.fork()
    if child:
        return child
    code = 70
    try:
        os.setsid()
        for number, target in ((0, os.open(given, os.O_RDONLY)), (1, os.open(printed, os.O_WRONLY | os.O_CREAT)), (2, said)):
            os.dup2(target, number)
        sys.stdin, sys.stdout = io.TextIOWrapper(os.fdopen(0, "rb")), io.TextIOWrapper(os.fdopen(1, "wb"))
        sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb"), write_through=True)
        prepare()
        wzsumo(words)
    except SystemExit as ended:
        code = int(ended.code or 0)
    except BaseException:  # noqa: BLE001 - it is what is looked for
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stderr.flush()
        os._exit(code)
