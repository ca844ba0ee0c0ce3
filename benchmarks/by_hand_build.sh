# What both loops by hand need; sourced, not run. Sets `made`, the folder for everything written.
set -eu
command -v psdmc > /dev/null || { echo "error: psdmc is not on PATH"; echo "hint: PATH=.venv/bin:\$PATH sh $0"; exit 2; }
made=generated/by_hand
mkdir -p "$made"

# timed_psdmc PROGRAM SOURCE PACKAGE: the loop of SOURCE with an emitted package's C
timed_psdmc() {
    gcc -std=c11 -O3 -march=native -ffp-contract=fast -fno-math-errno -fno-trapping-math \
        -fno-tree-slp-vectorize -I"$3/include" "$2" "$3"/src/[a-z]*.c -lm -o "$1"
}

# timed_pinocchio PROGRAM SOURCE: the loop of SOURCE with the Pinocchio of the wheel
timed_pinocchio() {
    prefix=$(python -c 'import pinocchio; print(pinocchio.__file__.rsplit("/lib/python", 1)[0])')
    g++ -std=c++17 -O3 -DNDEBUG -DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION -DBOOST_MPL_LIMIT_LIST_SIZE=30 \
        -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_FUSION_INVOKE_MAX_ARITY=12 \
        -isystem "$prefix/include" -isystem "$prefix/include/eigen3" "$2" \
        -L"$prefix/lib" -lpinocchio_default -Wl,-rpath,"$prefix/lib" -o "$1"
}
