#!/bin/sh
# psdmc's and Pinocchio's C on a floating anymal_b in loops that share no code with the bench: their ratios must agree with
# the bench's within 15 %. Usage, from the repository's root on an idle machine: PATH=.venv/bin:$PATH sh benchmarks/by_hand_anymal.sh
. benchmarks/by_hand_build.sh
python - "$made/anymal.txt" > "$made/anymal.path" <<'END'
import importlib.metadata
import sys

import pinocchio

wheel = importlib.metadata.distribution("example-robot-data")
path = next(f for f in wheel.files if str(f).endswith("anymal_b_simple_description/robots/anymal.urdf"))
path = str(wheel.locate_file(path))
model = pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer())
with open(sys.argv[1], "w") as text:
    for k in range(1, model.njoints):
        at, body = model.jointPlacements[k], model.inertias[k]
        values = [*at.rotation.flat, *at.translation, body.mass, *body.lever, *body.inertia.flat]
        print(model.joints[k].shortname(), model.parents[k], *(repr(float(v)) for v in values), file=text)
print(path)
END
psdmc derive "$(cat "$made/anymal.path")" --floating -o "$made/anymal.npz" > "$made/log" 2>&1
psdmc emit-c "$made/anymal.npz" -o "$made/anymal" >> "$made/log" 2>&1
timed_psdmc "$made/psdmc_anymal" benchmarks/by_hand_anymal.c "$made/anymal"
timed_pinocchio "$made/pinocchio_anymal" benchmarks/by_hand_anymal.cpp
"$made/psdmc_anymal"
"$made/pinocchio_anymal" "$made/anymal.txt"
