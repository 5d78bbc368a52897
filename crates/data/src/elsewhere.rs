//! Files that people have and that are not read here: what they are, and what to type in Python.

use std::path::Path;

use crate::FileError;

/// Extensions, what such a file is, and what turns it into one that is read. `FILE` and `STEM` stand for its names.
const FORMATS: &[(&[&str], &str, &str)] = &[
    (
        &["c3d"],
        "a C3D file of motion capture",
        "in Python: `import ezc3d, numpy as np; c = ezc3d.c3d(\"FILE\"); p = c[\"data\"][\"points\"][:3]; \
         np.savez(\"STEM.npz\", points=p.transpose(2, 1, 0).reshape(p.shape[2], -1), fps=c[\"header\"][\"points\"][\"frame_rate\"])`",
    ),
    (
        &["xlsx", "xls", "ods"],
        "a spreadsheet",
        "save it as CSV, or in Python: `import pandas as pd; pd.read_excel(\"FILE\").to_csv(\"STEM.csv\", index=False)`",
    ),
    (
        &["pkl", "pickle", "joblib"],
        "a Python pickle, which can run any program when it is opened",
        "in Python, if you trust it: `import pickle, numpy as np; d = pickle.load(open(\"FILE\", \"rb\"))`, then \
         `np.savez(\"STEM.npz\", **d)` for a dictionary of arrays, `np.savez(\"STEM.npz\", *d)` for a list of them",
    ),
    (
        &["pt", "pth"],
        "a file of PyTorch",
        "in Python: `import torch, numpy as np; d = torch.load(\"FILE\", weights_only=True)`, then \
         `np.savez(\"STEM.npz\", **{k: v.numpy() for k, v in d.items()})` for a dictionary of tensors",
    ),
    (
        &["feather", "arrow", "ipc"],
        "an Arrow table",
        "in Python: `import pyarrow.feather as f, pyarrow.parquet as pq; pq.write_table(f.read_table(\"FILE\"), \"STEM.parquet\")`",
    ),
    (
        &["fbx", "glb", "gltf"],
        "a scene with animation",
        "export the motion as BVH, e.g. from Blender: File, Export, Motion Capture (.bvh)",
    ),
    (
        &["zarr"],
        "a Zarr store",
        "in Python: `import zarr, numpy as np; z = zarr.open(\"FILE\", \"r\"); np.savez(\"STEM.npz\", **{k: z[k][:] for k in z.array_keys()})`",
    ),
    (
        &["tfrecord"],
        "a file of TensorFlow records",
        "in Python, with the data set's tensorflow_datasets builder, save each episode's arrays by `numpy.savez`",
    ),
    (
        &["jsonl", "ndjson"],
        "a file of JSON lines, which `scrnn recognize` takes as a stream (`-`), but `train` does not",
        "in Python: `import pandas as pd; pd.read_json(\"FILE\", lines=True).to_csv(\"STEM.csv\", index=False)`",
    ),
    (
        &["json"],
        "a JSON file",
        "in Python, for a dictionary of lists of numbers: `import json, numpy as np; np.savez(\"STEM.npz\", **json.load(open(\"FILE\")))`; \
         for a list of rows: `import pandas as pd; pd.read_json(\"FILE\").to_csv(\"STEM.csv\", index=False)`",
    ),
    (
        &["yaml", "yml"],
        "text in YAML",
        "what `ros2 topic echo` prints is read as a table if it is asked for with `--csv` and kept as a .csv; a recording by `ros2 bag record` is better",
    ),
    (
        &["arff"],
        "a table of Weka",
        "in Python: `from scipy.io import arff; import pandas as pd; pd.DataFrame(arff.loadarff(\"FILE\")[0]).to_csv(\"STEM.csv\", index=False)`",
    ),
    (
        &["trc"],
        "a file of marker tracks",
        "in Python: `import numpy as np; a = np.genfromtxt(\"FILE\", skip_header=6, invalid_raise=False); \
         np.savez(\"STEM.npz\", time=a[:, 1], markers=a[:, 2:])`; channels go x, y, z by marker, in the order of the file's fourth line",
    ),
    (&["zip", "gz", "tar", "tgz", "7z", "xz", "bz2", "zst"], "packed", "unpack it first"),
];

/// What to say of a file that is known, but not read.
#[must_use]
pub fn refusal(path: &Path) -> Option<FileError> {
    let extension = path.extension()?.to_string_lossy().to_ascii_lowercase();
    let (_, what, help) = FORMATS.iter().find(|(extensions, _, _)| extensions.contains(&extension.as_str()))?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let file = path.display().to_string();
    let help = help.replace("STEM", &stem).replace("FILE", &file);
    Some(FileError::Elsewhere { path: file, what, help })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_names_the_file() {
        let error = refusal(Path::new("data/walk.C3D")).unwrap();
        assert_eq!(error.to_string(), "data/walk.C3D is a C3D file of motion capture, which is not read here");
        let help = miette::Diagnostic::help(&error).unwrap().to_string();
        assert!(help.contains("ezc3d.c3d(\"data/walk.C3D\")") && help.contains("\"walk.npz\""), "{help}");
        assert!(refusal(Path::new("walk.csv")).is_none() && refusal(Path::new("walk")).is_none());
        for (extensions, _, help) in FORMATS {
            let known = |path: &str| refusal(Path::new(path)).is_some();
            assert!(extensions.iter().all(|extension| known(&format!("x.{extension}"))) && !help.is_empty());
        }
    }

    #[test]
    fn reading_says_so() {
        let error = crate::inspect(Path::new("demo.pkl"), &crate::Selection::default()).unwrap_err();
        assert!(error.to_string().contains("demo.pkl is a Python pickle"), "{error}");
    }
}
