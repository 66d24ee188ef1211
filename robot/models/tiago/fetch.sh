#!/bin/sh
# Gets the maker's URDF and meshes of TIAGo, which may not ship with this repository, from the Python package
# example-robot-data into the folder `fetched` beside this script:
#
#   robot/models/tiago/fetch.sh && dsm run EPISODE --robot tiago
#
# What is there already is not fetched again. Needs python3 with pip. Exit code 1: it cannot be had.
set -eu
version=6.0.0
checksum=424092a8093411ac2cd4ccc0572382bfc6b5eb4833aa984ef5e671dd67cd0a6e
urdf=example-robot-data/robots/tiago_description/robots/tiago_no_hand.urdf

here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)

fail() {
  echo "fetch.sh: $*" >&2
  exit 1
}

[ ! -f "$here/fetched/$urdf" ] || exit 0
command -v python3 >/dev/null || fail "python3 with pip is needed"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
python3 -m pip download "example-robot-data==$version" --no-deps --only-binary :all: --dest "$scratch" >&2 ||
  fail "pip cannot fetch example-robot-data==$version"
echo "$checksum  $(echo "$scratch"/*.whl)" | sha256sum --check --status - || fail "the checksum of the wheel is wrong"
python3 - "$scratch" <<'PYTHON' || fail "the wheel holds no TIAGo"
import glob, os, sys, zipfile
folder = sys.argv[1]
(wheel,) = glob.glob(f"{folder}/*.whl")
share = "cmeel.prefix/share/"
with zipfile.ZipFile(wheel) as archive:
    names = [n for n in archive.namelist() if n.startswith(share + "example-robot-data/robots/tiago_description/")]
    for name in names:
        target = os.path.join(folder, "fetched", name[len(share):])
        os.makedirs(os.path.dirname(target), exist_ok=True)
        with open(target, "wb") as out:
            out.write(archive.read(name))
sys.exit(not names)
PYTHON
[ -f "$scratch/fetched/$urdf" ] || fail "the wheel holds no $urdf"
rm -rf "$here/fetched"
mv "$scratch/fetched" "$here/fetched"
