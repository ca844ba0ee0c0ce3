#!/bin/sh
# Emitted packages of one robot, timed in turn: before and after a change of the generator. On an idle machine:
#   sh benchmarks/compare.sh ROBOT FOLDER...          such as kr6 generated/before generated/after
# CC and CFLAGS as make knows them; CFLAGS is added to psdmc's own flags.
set -eu
robot=$1
shift
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
first=$1
for folder in "$@"; do
    library="$made/$(echo "$folder" | tr / _).so"
    ${CC:-gcc} -std=c99 -O3 -march=native -ffp-contract=fast -fno-math-errno -fno-trapping-math -fno-tree-slp-vectorize -fPIC \
        ${CFLAGS:-} -shared -I"$folder/include" "$folder"/src/*.c -lm -o "$library"
    set -- "$@" "$library"
    shift
done
${CC:-gcc} -std=c11 -O2 -I"$first/include" -DROBOT="$robot" -DHEADER="<$robot/$robot.h>" benchmarks/compare.c -ldl -o "$made/compare"
"$made/compare" "$@"
