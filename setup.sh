#!/bin/bash
# Make the virtual environment $1 from requirements.lock, see that SUMO loads, and compile the kernels once.
set -euo pipefail
exec >&2
cd "$(dirname "$0")"
venv=$1
libraries="libgl1 libx11-6 libxext6 libxrender1 libatomic1 libexpat1" # what libsumo 1.28 links on Debian 12

say() { echo "setup: $*"; }

command -v python3 >/dev/null || { say "python3 is missing; Python 3.11 to 3.13 is needed"; exit 1; }
python3 -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))' ||
    { say "$(python3 -V) is not supported; Python 3.11 to 3.13 is needed"; exit 1; }
python3 -c 'import ensurepip, venv' 2>/dev/null ||
    { say "Python's venv module is missing; on Debian or Ubuntu: sudo apt-get install python3-venv"; exit 1; }

say "Python packages into $venv"
python3 -m venv "$venv"
pip() { "$venv/bin/python" -m pip --quiet --disable-pip-version-check "$@"; }
pip install --require-hashes -r requirements.lock
pip install --no-deps --no-build-isolation -e .

sumo_loads() { LIBSUMO_AS_TRACI=quiet "$venv/bin/python" -c 'import libsumo'; }
if ! sumo_loads 2>/dev/null; then
    install="apt-get install -y --no-install-recommends $libraries"
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        say "system libraries of SUMO: $libraries"
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive $install
        sumo_loads
    else
        sumo_loads || true
        say "SUMO lacks system libraries; run this, then make again: sudo apt-get update && sudo $install"
        exit 1
    fi
fi

say "compiling the kernels"
"$venv/bin/python" -m wzsumo warm
say "done"
