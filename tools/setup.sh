#!/usr/bin/env bash
# Makes .venv ready to run the project; nothing to do (and nothing said) when it already is.
set -euo pipefail
cd "$(dirname "$0")/.."
export LC_ALL=C.UTF-8 PYTHONNOUSERSITE=1 PIP_DISABLE_PIP_VERSION_CHECK=1
unset PYTHONPATH PYTHONHOME

log=.setup/log
unfinished=.setup/unfinished
stamp=.venv/.setup-stamp
asl=.venv/lib/libpynumero_ASL.so

say() { printf 'set-up: %s\n' "$*"; }
die() { printf 'set-up: %s\n' "$*" >&2; exit 1; }

run() {
    "$@" </dev/null >>"$log" 2>&1 && return
    tail -n 25 "$log" >&2
    die "this step failed; everything it said is in $log"
}

ipopt_version() { pkg-config --modversion ipopt 2>/dev/null || echo none; }

key() {
    {
        pwd -P && ipopt_version && .venv/bin/python -VV
        cat requirements.lock pyproject.toml tools/setup.sh tools/check_setup.py
    } | sha256sum
}

venv_fits() {
    .venv/bin/python -VV >/dev/null 2>&1 || return
    [ -z "${PYTHON:-}" ] || [ "$("$PYTHON" -VV 2>&1)" = "$(.venv/bin/python -VV)" ]
}

ready() {
    [ ! -e "$unfinished" ] && [ -s "$asl" ] && [ -s "$stamp" ] && venv_fits && [ "$(key)" = "$(cat "$stamp")" ]
}

# Prints the interpreter under any virtual environment or pyenv shim: .venv itself may be about to be cleared.
find_python() {
    local candidate candidates=(.venv/bin/python python3.11 python3)
    [ -z "${PYTHON:-}" ] || candidates=("$PYTHON")
    for candidate in "${candidates[@]}"; do
        "$candidate" -c 'import sys; sys.version_info < (3, 11) and sys.exit(1); print(sys._base_executable)' 2>/dev/null && return
    done
    return 0
}

has_headers() {
    "$1" -c 'import os, sys, sysconfig as s; sys.exit(not os.path.exists(s.get_config_var("INCLUDEPY") + "/Python.h"))'
}

missing_packages() {
    command -v dpkg-query >/dev/null || return 0
    local package
    for package in "$@"; do
        dpkg-query -W -f '${db:Status-Abbrev}\n' "$package" 2>/dev/null | grep -q '^.i' || echo "$package"
    done
}

install_packages() {
    local wanted="$*" as_root=()
    if [ "$(id -u)" != 0 ]; then
        command -v sudo >/dev/null || die "needs root or sudo once, for: apt-get install $wanted"
        as_root=(sudo)
    fi
    say "installing Debian packages: $wanted"
    local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300)
    # The lists may be absent (a new container) or older than the archive: fetch them only then.
    "${apt[@]}" install -y --no-install-recommends "$@" </dev/null >>"$log" 2>&1 && return
    say "refreshing Debian's package lists"
    run "${apt[@]}" update
    run "${apt[@]}" install -y --no-install-recommends "$@"
}

mkdir -p .setup
if [ "${1:-}" = browser ]; then  # the tests drive it
    command -v chromium chromedriver >/dev/null || install_packages chromium chromium-driver
    exit
fi

ready && exit 0

# The lock is inherited: a pip whose parent was killed holds it until it ends.
exec 9>.setup/lock
flock -n 9 || { say "waiting for another set-up in this folder"; flock 9; }
ready && exit 0
trap 'exit 130' INT
: >"$log"

python=$(find_python)
[ -n "$python" ] || [ -z "${PYTHON:-}" ] || die "PYTHON=$PYTHON is not a Python of version 3.11 or later"
wanted=(coinor-libipopt-dev libblas-dev liblapack-dev libamplsolver-dev g++)
command -v pkg-config >/dev/null || wanted+=(pkg-config)
case "$python" in
    '' | /usr/bin/* | /bin/*) wanted+=(python3-dev python3-venv) ;;
esac
mapfile -t missing < <(missing_packages "${wanted[@]}")
if [ "${#missing[@]}" -gt 0 ]; then
    install_packages "${missing[@]}"
    python=$(find_python)
fi

[ -n "$python" ] || die "no Python of version 3.11 or later found; name one: make PYTHON=/path/to/python3"
has_headers "$python" || die "$python has no headers (Python.h): install its development package, or name another: make PYTHON=..."
"$python" -c 'import ensurepip' 2>/dev/null || die "$python cannot make virtual environments (no ensurepip): name another: make PYTHON=..."
ipopt=$(ipopt_version)
[ "$ipopt" != none ] || die "pkg-config finds no Ipopt (Debian: coinor-libipopt-dev)"
asl_include=$(find /usr/include /usr/local/include -name asl_pfgh.h -printf '%h\n' 2>/dev/null | sort | head -n 1)
[ -n "$asl_include" ] || die "no header asl_pfgh.h of the AMPL solver library (Debian: libamplsolver-dev)"

if [ -e "$unfinished" ]; then
    say "the last set-up was interrupted: starting .venv afresh"
    rm -rf .venv
fi
touch "$unfinished"
# A moved or copied folder brings scripts that name the old place.
if ! { venv_fits && [ "$("$python" -VV)" = "$(.venv/bin/python -VV)" ] && grep -qF "$(pwd -P)/.venv" .venv/bin/activate &&
    .venv/bin/python -m pip --version >/dev/null 2>&1; }; then
    say "new virtual environment .venv with $("$python" -V)"
    run "$python" -m venv --clear .venv
fi

pip=(.venv/bin/python -m pip install --no-input)
awk -v out=.setup '/^[a-z0-9]/ { file = out (/^cyipopt==/ ? "/cyipopt.lock" : "/others.lock") } { print > file }' requirements.lock
say "Python packages as locked"
run "${pip[@]}" --require-hashes -r .setup/others.lock

# Any cached or earlier build may be linked to another Ipopt.
force=()
[ "$(cat .venv/.ipopt-version 2>/dev/null)" = "$ipopt" ] || force=(--force-reinstall)
say "cyipopt, compiled here against Ipopt $ipopt"
run "${pip[@]}" --require-hashes --no-deps --no-build-isolation --no-cache-dir --no-binary cyipopt "${force[@]}" -r .setup/cyipopt.lock
echo "$ipopt" >.venv/.ipopt-version
run "${pip[@]}" --no-deps --no-build-isolation -e .

say "PyNumero's AMPL interface"
source=$(.venv/bin/python -c 'import pathlib, pyomo; print(pathlib.Path(pyomo.__file__).parent / "contrib/pynumero/src")')
run g++ -O2 -shared -fPIC -Wl,--no-undefined -I"$asl_include" -o "$asl.new" "$source/AmplInterface.cpp" -l:libamplsolver.a -lm -ldl
mv "$asl.new" "$asl"

.venv/bin/python tools/check_setup.py || die "the check failed: the next make starts .venv afresh"
key >.setup/stamp
rm "$unfinished"
mv .setup/stamp "$stamp"
