"""Where compiled kernels are kept: a folder named after the sources, so that a stale kernel can never be loaded.

numba notices a change of the file that holds a function, but not of the helpers and globals it was compiled with. The
folder's name therefore carries a hash of every module under `renderers`. It lies below NUMBA_CACHE_DIR where that is
set, else in the user's cache folder. Runs before numba is imported, when `aliasbench.renderers` is.
"""

import hashlib
import os
import sys
from pathlib import Path

_PREFIX = "kernels-"


def source_digest(folder: Path) -> str:
    """Return 16 hex digits of the SHA-256 over the Python files below a folder, names included."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_root() -> Path:
    """Return the folder for everything the project keeps between runs (XDG_CACHE_HOME or ~/.cache, aliasbench)."""
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "aliasbench"


def use_kernel_cache() -> None:
    """Point numba at the folder of these sources, in this process and the ones it starts."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    base = Path(given) if given else cache_root()
    if base.name.startswith(_PREFIX):
        base = base.parent
    folder = str(base / (_PREFIX + source_digest(Path(__file__).parent)))
    os.environ["NUMBA_CACHE_DIR"] = folder
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = folder
