#!/bin/sh
# Sets up .venv and the system packages it needs; does nothing where all is there. `setup.sh browser` adds Chromium
# and OSMesa, which only tests use.
set -eu
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
root=""
if [ "$(id -u)" = 0 ]; then root="env"; elif sudo -n true 2>/dev/null; then root="sudo -n"; fi

say() { printf '%s\n' "$*" >&2; }

has_library() { ldconfig -p 2>/dev/null | grep -q "$1" || /sbin/ldconfig -p 2>/dev/null | grep -q "$1"; }

install() {  # packages: installs them with apt, or names them
    if [ -n "$root" ] && command -v apt-get >/dev/null 2>&1; then
        say "installing $*"
        $root apt-get update -qq >/dev/null || return 1
        $root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
    else
        return 1
    fi
}

"$python" -c 'import sys; raise SystemExit(sys.version_info < (3, 11))' 2>/dev/null || {
    say "python3 3.11 or later is needed; $python is not (set PYTHON to one that is)."
    exit 2
}

missing=""
has_library libEGL.so.1 || missing="$missing libegl1"
has_library libGL.so.1 || missing="$missing libgl1"
has_library libEGL_mesa.so.0 || has_library libEGL_nvidia.so.0 || missing="$missing libegl-mesa0 libgl1-mesa-dri"
[ -x .venv/bin/python ] || "$python" -c 'import ensurepip, venv' 2>/dev/null || missing="$missing python3-venv"
if [ -n "$missing" ]; then
    # shellcheck disable=SC2086
    install $missing || {
        say "missing system packages, and no way to install them from here; run as root: apt-get install$missing"
        exit 2
    }
fi

wanted=$(cat pyproject.toml constraints.txt .ci/setup.sh | cksum)
if [ "$(cat .venv/.ready 2>/dev/null || true)" != "$wanted" ]; then
    say "setting up .venv (the first time downloads some 300 MB)"
    [ -x .venv/bin/python ] || "$python" -m venv .venv
    # The constraints hold for the build environment too, so that a fresh install is the same every time.
    PIP_CONSTRAINT=constraints.txt PIP_DISABLE_PIP_VERSION_CHECK=1 .venv/bin/python -m pip install -q -e ".[dev]"
    printf '%s\n' "$wanted" >.venv/.ready
fi

# mypy cannot see through an editable install whose import name is a namespace over "."; this tree of links it can.
if [ ! -e .typing/aliasbench/scenes ]; then
    mkdir -p .typing/aliasbench
    for folder in bench metrics renderers reports scenes; do ln -sfn "../../$folder" ".typing/aliasbench/$folder"; done
fi

if [ "${1:-}" = browser ]; then
    missing=""
    command -v chromium >/dev/null 2>&1 || missing="$missing chromium"
    has_library libatomic.so.1 || missing="$missing libatomic1"  # what drives the browser needs it
    if [ -n "$missing" ]; then
        # shellcheck disable=SC2086
        install $missing || say "the browser tests will fail; run as root: apt-get install$missing"
    fi
    # The other GL backend; newer systems no longer have it, and its tests then say so.
    has_library libOSMesa || install libosmesa6 || say "no OSMesa here: its tests check what is said of that"
fi
