"""Text files of the user's, read so that each way in which they can be wrong has its message."""

from __future__ import annotations

from pathlib import Path
from stat import S_ISDIR, S_ISREG

from orchestrator.coupling.errors import InputError

MOST = 64 * 2**20
"""Bytes of a file that people write; tables of inputs are the largest."""


def text_of(path: Path, what: str) -> str:
    """Return the text of a file, whatever its line ends, with or without a byte order mark.

    Parameters
    ----------
    what : it should be, ``a TOML file``

    Raises
    ------
    InputError : there is no such file, it is a folder or a pipe, too large, or no UTF-8
    """
    try:
        require_file(path, what)
        if path.stat().st_size > MOST:
            raise InputError(f"{path}: has {path.stat().st_size / 2**20:.0f} MB; {what} may have {MOST // 2**20}")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not {what}: no UTF-8 text ({error.reason}); save it as UTF-8") from None
    except ValueError as error:  # a name that no file can have
        raise InputError(f"{path!s}: cannot be read ({error}); check the path") from None


def is_file(path: Path) -> bool:
    """Return whether `path` is a file that can be read: False too where nobody may look, or no file can have that name."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def require_file(path: Path, what: str) -> None:
    """Raise `InputError` where reading would not end, `OSError` where nothing is there."""
    mode = path.stat().st_mode
    if not S_ISREG(mode):
        raise InputError(f"{path}: is {'a folder' if S_ISDIR(mode) else 'no regular file'}; give {what}")
