#!/bin/sh
# Make the environment .venv of this checkout: the locked packages, then saltus itself, editable.
#
#   tools/make_env.sh run     what saltus needs to run
#   tools/make_env.sh test    that, and what its tests need
#   tools/make_env.sh docs    what saltus needs to run, and what its site is built by
#
# PYTHON names the interpreter; without it the first one that the lock files serve is taken.
# Nothing outside the checkout is changed, and a call that finds nothing to do returns at once.
set -eu
cd "$(dirname "$0")/.."
root=$(pwd -P)
newest=14 # of Python 3.x: the last one for which every locked package has a wheel

lock_of() {
    case $1 in
        run) echo requirements.lock ;;
        test | docs) echo "requirements-$1.lock" ;;
        *) return 1 ;;
    esac
}

lock=$(lock_of "${1:-}") || {
    echo "usage: tools/make_env.sh run|test|docs" >&2
    exit 2
}
unset PYTHONHOME PYTHONPATH
export PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1

stop() {
    echo "make_env: $1" >&2
    exit 1
}

# Print the version of interpreter $1; fail unless it is 3.11 to 3.$2 ($2 absent: or later).
version_of() {
    "$1" -c 'import sys
print("%d.%d.%d" % sys.version_info[:3])
sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, int(sys.argv[1])))' "${2:-99}" 2>/dev/null
}

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        version_of "$PYTHON" >/dev/null || stop "PYTHON=$PYTHON is not a Python of version 3.11 or later"
        echo "$PYTHON"
        return
    fi
    for name in python3 python3.14 python3.13 python3.12 python3.11 python; do
        if version_of "$name" $newest >/dev/null; then
            echo "$name"
            return
        fi
    done
    stop "found no Python 3.11 to 3.$newest; install one, or name one: make PYTHON=/path/to/python3 ..."
}

# .venv is a whole environment, was made here (its scripts hold the path), and is of the Python asked for.
venv_fits() {
    .venv/bin/python -c 'import sys; sys.exit(sys.prefix == sys.base_prefix)' 2>/dev/null || return 1
    [ "$(cat .venv/.made-at 2>/dev/null || echo "$root")" = "$root" ] || return 1
    found=$(version_of .venv/bin/python) || return 1
    [ -z "${PYTHON:-}" ] || [ "$found" = "$(version_of "$PYTHON")" ]
}

# Find a pip that can install into .venv, its own or one from outside, for run_pip.
find_pip() {
    for pip in own outer pip3 pip; do
        run_pip --version >/dev/null 2>&1 && return
    done
    return 1
}

run_pip() {
    case $pip in
        own) .venv/bin/python -m pip "$@" ;;
        outer) "$python" -m pip --python .venv/bin/python "$@" ;;
        *) "$pip" --python .venv/bin/python "$@" ;;
    esac
}

# Try the command given, which makes .venv; leave nothing behind if what it made cannot be used.
try() {
    rm -rf .venv
    "$@" >/dev/null 2>&1 && find_pip && return
    rm -rf .venv
    return 1
}

make_venv() {
    echo "make_env: making .venv with $python ($(version_of "$python"))"
    # Bare Debian has no ensurepip: its first attempt fails and leaves a broken folder.
    try "$python" -m venv .venv ||
        try "$python" -m venv --without-pip .venv ||
        try "$python" -m virtualenv .venv ||
        try virtualenv --python "$python" .venv ||
        stop "$python cannot make an environment: apt install python3-venv (elsewhere: install pip or virtualenv for it)"
}

# All that the environment for lock file $1 depends on.
recipe() {
    echo "$root"
    version_of .venv/bin/python
    cat "$1" pyproject.toml src/saltus/version.py
}

# The environment holds what purpose $1 asks for.
made_for() {
    [ "$(recipe "$(lock_of "$1")")" = "$(cat ".venv/.recipe-$1" 2>/dev/null)" ]
}

if venv_fits && made_for "$1"; then
    exit 0
fi
python=$(find_python)
if ! venv_fits || ! find_pip; then
    make_venv
fi
echo "$root" >.venv/.made-at
# What was installed for another purpose stays good as long as its lock file is the same.
for kind in run test docs; do
    made_for $kind || rm -f ".venv/.recipe-$kind"
done
echo "make_env: installing $lock"
# Python compiles what is imported; to compile all packages takes a minute
run_pip install -qq --no-compile --require-hashes -r "$lock"
run_pip install -qq --no-deps --no-build-isolation --editable .
recipe requirements.lock >.venv/.recipe-run # the other locks hold all of it
[ "$1" = run ] || recipe "$lock" >".venv/.recipe-$1"
