"""Results that appear whole or not at all."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wzsumo.errors import OutputError


@contextmanager
def staged_folder(out: Path) -> Iterator[Path]:
    """An empty folder to write to; at the end of the block its files move into `out`, replacing those of the same name.

    If the block fails nothing of it stays, and other files in `out` are not touched. Raises OutputError where `out` cannot
    be written to.
    """
    existed = out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=out))
    except OSError as error:
        raise OutputError(
            f"--out {out}: cannot be written to ({error.strerror}); name a folder that you may write to"
        ) from None
    try:
        yield stage
        for path in sorted(stage.rglob("*")):
            target = out / path.relative_to(stage)
            if path.is_dir():
                target.mkdir(exist_ok=True)
            else:
                path.replace(target)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        if not existed and not any(out.iterdir()):
            out.rmdir()
