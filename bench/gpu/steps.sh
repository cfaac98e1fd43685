#!/bin/sh
# Runs `python -m bench gpu` on a GPU machine without a package index, in steps that bring one piece of Warp each.
# `python -m bench gpu-prepare FOLDER` makes the pieces and prints the steps. In the root of a copy of the
# repository, which holds FOLDER with the files of the step:
#
#     sh bench/gpu/steps.sh start FOLDER            keeps the first piece and starts to build wive in the background
#     sh bench/gpu/steps.sh piece FOLDER            keeps another piece
#     sh bench/gpu/steps.sh run FOLDER [OPTIONS]    keeps the last piece and the scenes, waits for the build, runs
#
# `run` again, without pieces, runs the bench with other options.
set -eu

work=${WIVE_GPU_WORK:-${TMPDIR:-/tmp}/wive-gpu}
longest_wait=${WIVE_GPU_WAIT:-300} # seconds
python=${PYTHON:-python3}

fail() {
    echo "steps.sh: $1" >&2
    exit 1
}

keep() {
    for file in "$1"/warp.*-of-*; do
        if [ -e "$file" ]; then cp "$file" "$work/"; fi
    done
    if [ -d "$1/scenes" ]; then cp -r "$1/scenes" "$work/"; fi
}

start() {
    rm -rf "$work"
    mkdir -p "$work/site"
    cp -r . "$work/source"
    keep "$1"
    # On a line of its own: `copy && build &` would put the copy in the background as well.
    setsid nohup sh "$work/source/bench/gpu/steps.sh" build "$1" >"$work/build.log" 2>&1 </dev/null &
    echo "$!" >"$work/started"
}

build() {
    cd "$work/source"
    status=0
    CMAKE_BUILD_PARALLEL_LEVEL=$(nproc) "$python" -m pip install --quiet --no-build-isolation --no-deps --no-index \
        --target "$work/site" . || status=$?
    echo "$status" >"$work/built"
}

require_start() {
    [ -e "$work/started" ] || fail "the build has not been started: run step 'start' first"
}

wait_for_build() {
    waited=0
    while [ ! -e "$work/built" ]; do
        [ "$waited" -lt "$longest_wait" ] || fail "the build has not ended after $longest_wait s: see $work/build.log"
        sleep 1
        waited=$((waited + 1))
    done
    cat "$work/build.log"
    [ "$(cat "$work/built")" = 0 ] || fail "the build has failed"
}

unpack_warp() {
    if [ -d "$work/site/warp" ]; then return; fi
    set -- "$work"/warp.*-of-*
    [ -e "$1" ] || fail "there is no piece of Warp"
    [ "$#" = "${1##*-of-}" ] || fail "there are $# of ${1##*-of-} pieces of Warp"
    cat "$@" >"$work/warp.zip"
    "$python" -m zipfile -e "$work/warp.zip" "$work/site"
    rm "$work/warp.zip"
}

step=${1:-}
folder=${2:-}
[ -n "$folder" ] || fail "expected start, piece or run, and a folder"
shift 2
case $step in
start) start "$folder" ;;
build) build ;;
piece)
    require_start
    keep "$folder"
    ;;
run)
    require_start
    keep "$folder"
    wait_for_build
    unpack_warp
    cd "$work/source"
    export PYTHONPATH="$work/site" PYTHONUNBUFFERED=1 WARP_CACHE_PATH="$work/cache"
    exec "$python" -m bench gpu --scene-dir "$work/scenes" "$@"
    ;;
*) fail "expected start, piece or run, got $step" ;;
esac
