#!/bin/sh
# Makes the corpora that fuzzing starts from, with the program itself and the files that are kept in the repository:
#   fuzz/seeds.sh target/release/scrnn
# Then e.g. `cargo +nightly fuzz run -s none table -- -runs=1000000 -max_len=4096`.
set -eu
scrnn=$(realpath "${1:-target/release/scrnn}")
cd "$(dirname "$0")"
for target in table npy npz mcap sqlite cdr protobuf bag experiment checkpoint urdf parquet hdf5 mat bvh series stream history notes; do mkdir -p "corpus/$target"; done
for kind in csv tsv txt; do "$scrnn" data lissajous --sequences 2 --steps 4 --out "corpus/table/x.$kind" -q; done
rm -f corpus/*/*.truth.*
printf 'sequence;step;y 1;"y ""2"""\na;1;0,5;2\na;2;1;3\n\nb;1;nan;-1e9\n' > corpus/table/semicolons
printf '# columns: a b\n# sequence: x\n1 2\n3 4\n\n# sequence: y\n5 inf\n' > corpus/table/comments
printf '1\t1\t2\t3\t4\t5\t6\t7\t8\t9\t9.5\n2\t-5\t-4\t-3\t-2\t-1\t0\t1\t2\t3\t4\n1\t9\t8\t7\t6\t5\t4\t3\t2\t1\tNaN\n2\t0\t0\t1\t1\t2\t2\t3\t3\t4\t4\n' > corpus/table/classes
printf 'Trajectories\n100\n,,A:hip,,,A:knee\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n1,0,1,2,3,4,5,6\n2,0,1,2,3,4,5,6\n' > corpus/table/vicon
printf 'FREQUENCY\t50\nDATA_INCLUDED\t3D\nMARKER_NAMES\thip\tknee\n1.5\t2\t3\t4\t5\t6\n1.5\t2\t3\t4\t5\t6\n' > corpus/table/qualisys
"$scrnn" data lissajous --sequences 2 --steps 4 --out corpus/npy/x.npy -q
"$scrnn" data lissajous --sequences 2 --steps 4 --out corpus/npz/x.npz -q
rm -f corpus/*/*.truth.*
cp ../assets/experiments/*.toml corpus/experiment/
cp ../tests/golden/run/*.safetensors corpus/checkpoint/
cp ../tests/golden/run/experiment.toml corpus/experiment/
cp corpora/*.mcap corpus/mcap/
cases=../crates/data/tests/cases
cp "$cases"/1*/*.mcap "$cases"/14-cdr-jointstate/bag/bag.mcap corpus/mcap/
cp "$cases"/14-cdr-jointstate/bag3/bag3.db3 corpus/sqlite/
printf 'float64 x\nOther[] y\nstring[<=2] z\n===\nMSG: pkg/Other\nuint8[3] a\nbool b\n\0\0\1\0\0\1\0\0\0\0\0\0\0\1\0\0\0\1\2\3\1' > corpus/cdr/msg
printf 'module pkg { module msg { struct Thing { double x; sequence<long, 3> y; string<4> z[2]; }; }; };\0\0\1\0\0\1\0\0\0\0\0\0\0' > corpus/cdr/idl
printf '\012\037\022\001a\042\022\012\005Thing\022\011\012\001x\030\001\040\001\050\001\142\006proto3\377\011\0\0\0\0\0\0\360\077' > corpus/protobuf/thing
{ printf '  relative_file_paths:\n  - a.mcap\n\0'; cat corpora/plain.mcap; } > corpus/bag/plain
[ ! -e ../assets/nao/nao.urdf ] || cp ../assets/nao/nao.urdf corpus/urdf/
printf '<robot name="a"><link name="b"/><link name="c"/><joint name="d" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>' > corpus/urdf/small
fixtures=../crates/data/tests/fixtures
cp "$fixtures"/parquet/*.parquet corpus/parquet/
cp "$fixtures"/hdf5/*.h5 "$fixtures"/hdf5/*.hdf5 corpus/hdf5/
cp "$fixtures"/mat/*.mat "$fixtures"/hdf5/matlab.mat corpus/mat/
printf 'HIERARCHY\nROOT a b\n{\nOFFSET 0 0 0\nCHANNELS 2 Xposition Zrotation\nEnd Site\n{\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.02\n1 2\n3 -4e1\n' > corpus/bvh/small
printf '@dimensions 2\n@timeStamps false\n@classLabel true a b\n@data\n1,2:3,?:a\n5:6:b\n' > corpus/series/plain
printf '@timeStamps true\n@classLabel false\n@data\n(0,1),(0.5,2)\n' > corpus/series/times
printf '# a\na,b\n1,2\n,3\nNaN;1e400\n\n1 2\n' > corpus/stream/names
printf '{"a":1,"b":null,"time":{"sec":1}}\n{"b":NaN,"a":-1e400}\n' > corpus/stream/objects
printf '{"header":{},"name":["b","a"],"position":[2,1]}\n{"name":[],"position":[]}\n' > corpus/stream/joints
printf 'sequence\tstep\ty1\ty2\none\t1\t1\t2\ntwo\t1\t3\t"4"\n5\t6' > corpus/stream/sequences
cp ../tests/golden/run/history.csv corpus/history/
printf 'epoch,nll,mse,rate_shared,rate_initial,gradient_norm,seconds\n0,,1,1,1,1,0.5\n5,inf,nan,1,1,1,1\n' > corpus/history/old
cp corpora/notes.json corpus/notes/
