#!/bin/sh
# psdmc's and Pinocchio's C on the KR6 in loops that share no code with the bench: their ratios must agree with the
# bench's within 15 %. Usage, from the repository's root on an idle machine: PATH=.venv/bin:$PATH sh benchmarks/by_hand.sh
. benchmarks/by_hand_build.sh
psdmc derive examples/robots/kr6.toml -o "$made/kr6.npz" > "$made/log" 2>&1
psdmc emit-c "$made/kr6.npz" -o "$made/kr6" \
    --functions default,inverse_dynamics_derivatives,forward_dynamics_derivatives,inverse_dynamics_vjp,forward_dynamics_vjp >> "$made/log" 2>&1
timed_psdmc "$made/psdmc" benchmarks/by_hand.c "$made/kr6"
timed_pinocchio "$made/pinocchio" benchmarks/by_hand_pinocchio.cpp
"$made/psdmc"
"$made/pinocchio"
