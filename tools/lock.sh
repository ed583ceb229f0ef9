#!/bin/sh
# Resolve the dependencies of pyproject.toml into the lock files, for every platform and Python at once.
# Versions already locked stay, unless an argument such as --upgrade or --upgrade-package=numpy says otherwise.
set -eu
cd "$(dirname "$0")/.."

if [ ! -x .venv-lock/bin/uv ]; then
    rm -rf .venv-lock
    "${PYTHON:-python3}" -m venv .venv-lock
    .venv-lock/bin/python -m pip install --quiet uv
fi

# Only hashes and versions are written down: no addresses, so that any index or mirror serves.
resolve() {
    .venv-lock/bin/uv pip compile pyproject.toml --group build --quiet --no-config \
        --universal --python-version 3.11 --fork-strategy fewest \
        --generate-hashes --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" "$@"
}

resolve --output-file requirements.lock --extra standard "$@"
resolve --output-file requirements-test.lock --extra test --constraints requirements.lock "$@"
resolve --output-file requirements-docs.lock --extra docs --constraints requirements-test.lock "$@"
