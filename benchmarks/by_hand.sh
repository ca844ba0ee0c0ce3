#!/bin/sh
# psdmc's and Pinocchio's C on the KR6 in loops that share no code with the bench: their ratios must agree with the
# bench's within 15 %. Usage, from the repository's root on an idle machine: PATH=.venv/bin:$PATH sh benchmarks/by_hand.sh
set -eu
made=generated/by_hand
mkdir -p "$made"
psdmc derive examples/robots/kr6.toml -o "$made/kr6.npz" > "$made/log" 2>&1
psdmc emit-c "$made/kr6.npz" -o "$made/kr6" \
    --functions default,inverse_dynamics_derivatives,forward_dynamics_derivatives,inverse_dynamics_vjp,forward_dynamics_vjp >> "$made/log" 2>&1
gcc -std=c11 -O3 -march=native -ffp-contract=fast -fno-math-errno -fno-trapping-math \
    -fno-tree-slp-vectorize -I"$made/kr6/include" \
    benchmarks/by_hand.c "$made"/kr6/src/[a-z]*.c -lm -o "$made/psdmc"
prefix=$(python -c 'import pinocchio; print(pinocchio.__file__.rsplit("/lib/python", 1)[0])')
g++ -std=c++17 -O3 -DNDEBUG -DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION -DBOOST_MPL_LIMIT_LIST_SIZE=30 \
    -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_FUSION_INVOKE_MAX_ARITY=12 \
    -isystem "$prefix/include" -isystem "$prefix/include/eigen3" benchmarks/by_hand_pinocchio.cpp \
    -L"$prefix/lib" -lpinocchio_default -Wl,-rpath,"$prefix/lib" -o "$made/pinocchio"
"$made/psdmc"
"$made/pinocchio"
