//! Data that the program has never seen: each kind of file is trained on, generated from and recognised.

use std::io::Write;

use crate::{Place, numbers};

const EXPERIMENT: &str = r#"
name = "mine"
[data]
files = ["FILE"]
[[network.groups]]
name = "context"
units = 8
time_constant = 3.0
[training]
epochs = 400
optimiser = "adam"
[training.adam]
rate = 0.02
"#;

/// Two channels in units of their own, around 1200 and 0.003.
fn sample(k: usize, phase: f64) -> [f64; 2] {
    let angle = k as f64 / 3.0 + phase;
    [1200.0 + 100.0 * angle.sin(), 0.003 + 0.001 * angle.cos()]
}

/// Trains on the file, lets the network run, and asks it for the file again.
fn works(place: &Place, file: &str, channels: &[&str], lengths: &[usize]) {
    place.write("mine.toml", EXPERIMENT.replace("FILE", file));
    let seen = place.json(&format!("inspect {file} --json"));
    let samples: Vec<usize> =
        seen["sequences"].as_array().unwrap().iter().map(|s| s["samples"].as_u64().unwrap() as usize).collect();
    assert_eq!(samples, lengths);
    let names: Vec<&str> = seen["channels"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert_eq!(names, channels);

    let trained = place.json("train mine.toml --json");
    assert!(trained["nll"].as_f64().unwrap() < trained["constant_model"]["nll"].as_f64().unwrap() - 0.5, "{trained}");

    for mode in ["open", "closed", "mixed"] {
        let generated = place.json(&format!("generate runs/mine --mode {mode} --json"));
        assert_eq!(generated["channels"], seen_channels(channels));
        for (sequence, length) in generated["sequences"].as_array().unwrap().iter().zip(lengths) {
            assert_eq!(sequence["mean"].as_array().unwrap().len(), length - 1);
            let first: Vec<f64> = numbers(&sequence["mean"]).into_iter().step_by(2).collect();
            assert!(first.iter().all(|&y| (1000.0..1400.0).contains(&y)), "{mode}: {first:?}");
            // In the data's units a variance of the first channel is some 1e10 times one of the second.
            let variances = numbers(&sequence["variance"]);
            let least = variances.iter().step_by(2).fold(f64::INFINITY, |least, &v| least.min(v));
            let most = variances.iter().skip(1).step_by(2).fold(0.0, |most: f64, &v| most.max(v));
            assert!(most > 0.0 && least > 1e4 * most, "{mode}: {least}, {most}");
        }
    }

    let found = place.json(&format!("recognize runs/mine {file} --starts 4 --epochs 40 --json"));
    let found = found["sequences"].as_array().unwrap();
    assert_eq!(found.len(), lengths.len());
    for (s, one) in found.iter().enumerate() {
        assert_eq!(one["learned"][0]["number"], s + 1, "{one}");
        assert_eq!(one["trials"].as_array().unwrap().len(), 4);
    }
}

fn seen_channels(channels: &[&str]) -> serde_json::Value {
    channels.iter().copied().collect()
}

#[test]
fn a_whitespace_file_with_sequences_of_different_lengths() {
    let place = Place::new();
    let mut text = String::from("# recorded on a Tuesday\n");
    for (length, phase) in [(60, 0.0), (35, 2.5)] {
        for k in 0..length {
            let [a, b] = sample(k, phase);
            text += &format!("{a:>12.4}\t {b:e}\n");
        }
        text += "\n";
    }
    place.write("mine.txt", text);
    works(&place, "mine.txt", &["y1", "y2"], &[60, 35]);
}

#[test]
fn a_csv_as_pandas_writes_it() {
    let place = Place::new();
    let mut text = String::from(",sequence,left,right\n");
    for (s, (length, phase)) in [(45, 0.0), (50, 2.5)].into_iter().enumerate() {
        for k in 0..length {
            let [a, b] = sample(k, phase);
            text += &format!("{k},trial {s},{a},{b}\r\n");
        }
    }
    place.write("mine.csv", text);
    works(&place, "mine.csv", &["left", "right"], &[45, 50]);
}

#[test]
fn an_npz_as_numpy_writes_it() {
    let place = Place::new();
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, length, phase) in [("left.npy", 40, 0.0), ("right.npy", 55, 2.5)] {
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        archive.start_file(name, options).unwrap();
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({length}, 2), }}");
        archive.write_all(b"\x93NUMPY\x01\x00").unwrap();
        archive.write_all(&118_u16.to_le_bytes()).unwrap();
        archive.write_all(format!("{header:117}\n").as_bytes()).unwrap();
        for value in (0..length).flat_map(|k| sample(k, phase)) {
            archive.write_all(&value.to_le_bytes()).unwrap();
        }
    }
    place.write("mine.npz", archive.finish().unwrap().into_inner());
    works(&place, "mine.npz", &["y1", "y2"], &[40, 55]);
}

#[test]
fn several_files_are_learned_together() {
    let place = Place::new();
    for (name, phase) in [("a", 0.0), ("b", 2.5)] {
        let rows: String = (0..40).map(|k| sample(k, phase)).map(|[a, b]| format!("{a},{b}\n")).collect();
        place.write(&format!("{name}.csv"), format!("left,right\n{rows}"));
    }
    place.write("mine.toml", EXPERIMENT.replace("[\"FILE\"]", "[\"a.csv\", \"b.csv\"]"));
    place.ok("train mine.toml --epochs 3");
    let seen = place.json("inspect runs/mine --json");
    assert_eq!(seen["lengths"], serde_json::json!([40, 40]));
    assert!(seen["sequences"][0].as_str().unwrap().starts_with("a/"), "{seen}");
    place.write("b.csv", "left,wrong\n1,2\n");
    let (_, told) = place.fails(2, "train mine.toml --out other");
    assert!(told.contains("left, wrong") && told.contains("left, right"), "{told}");
}
