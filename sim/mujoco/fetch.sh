#!/bin/sh
# Gets the MuJoCo library that the feature `mujoco` links with: the wheel of exactly the version that the crate
# mujoco-rs wraps, from the Python package index, into target/mujoco-VERSION of the repository.
#
#   export "$(sim/mujoco/fetch.sh)" && cargo build --release --features mujoco
#
# The only line on stdout sets MUJOCO_DYNAMIC_LINK_DIR. What is there already is not fetched again. Needs pip and Linux
# on x86-64. Exit code 1: the library cannot be had.
set -eu
version=3.17.0
checksum=23496b023ee80fb61ab71167e94bc649f9941710fde96b18bb8204fb332523ad

root=$(CDPATH= cd -- "$(dirname -- "$0")/../.." && pwd)
folder=$root/target/mujoco-$version
library=$folder/libmujoco.so.$version

fail() {
  echo "fetch.sh: $*" >&2
  exit 1
}

is_right() {
  [ -f "$1" ] && echo "$checksum  $1" | sha256sum --check --status -
}

if ! is_right "$library"; then
  [ "$(uname -s)-$(uname -m)" = Linux-x86_64 ] || fail "only Linux on x86-64 is supported"
  command -v python3 >/dev/null || fail "python3 with pip is needed"
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  # The wheel of one Python version holds the same library as that of any other.
  python3 -m pip download "mujoco==$version" --no-deps --only-binary :all: --python-version 3.11 \
    --platform manylinux_2_28_x86_64 --platform manylinux_2_27_x86_64 --dest "$scratch" >&2 ||
    fail "pip cannot fetch mujoco==$version"
  python3 - "$scratch" "mujoco/libmujoco.so.$version" <<'PYTHON' || fail "the wheel holds no library"
import glob, sys, zipfile
folder, name = sys.argv[1:]
(wheel,) = glob.glob(f"{folder}/*.whl")
with zipfile.ZipFile(wheel) as archive, open(f"{folder}/library", "wb") as out:
    out.write(archive.read(name))
PYTHON
  is_right "$scratch/library" || fail "the checksum of libmujoco.so.$version is not $checksum"
  mkdir -p "$folder"
  mv "$scratch/library" "$library"
fi
ln -sf "libmujoco.so.$version" "$folder/libmujoco.so"
echo "MUJOCO_DYNAMIC_LINK_DIR=$folder"
