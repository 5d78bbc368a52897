//! Channels of new data: names decide, not positions.

use crate::{Place, SINE};

fn experiment(files: &str) -> String {
    SINE.replace("task = \"sinusoid\"\nsteps = 80", files)
}

/// Two channels of different sizes, in this order of columns.
fn table(names: [&str; 2], order: [usize; 2]) -> String {
    let row = |step: u32| {
        let values = [(0.3 * f64::from(step)).sin(), 90.0 + 30.0 * (0.3 * f64::from(step)).cos()];
        format!("{:?},{:?}\n", values[order[0]], values[order[1]])
    };
    format!("{},{}\n{}", names[order[0]], names[order[1]], (0..60).map(row).collect::<String>())
}

#[test]
fn columns_in_another_order_give_the_same_bits_and_other_names_are_refused() {
    let place = Place::with(&experiment("files = [\"arm.csv\"]"));
    place.write("arm.csv", table(["shoulder", "elbow"], [0, 1]));
    place.write("swapped.csv", table(["shoulder", "elbow"], [1, 0]));
    place.write("nameless.csv", table(["shoulder", "elbow"], [0, 1]).split_once('\n').unwrap().1);
    place.write("others.csv", table(["knee", "hip"], [0, 1]));
    place.ok("train sine.toml --out run");
    for command in ["recognize run FILE --starts 2 --epochs 5 --json", "generate run --mode open --data FILE --json"] {
        let of = |file: &str| place.json(&command.replace("FILE", file))["sequences"].clone();
        assert_eq!(of("swapped.csv"), of("arm.csv"), "{command}");
        assert_eq!(of("nameless.csv"), of("arm.csv"), "{command}");
        let (_, told) = place.fails(2, &command.replace("FILE", "others.csv"));
        assert!(told.contains("`shoulder`") && told.contains("`knee`"), "{told}");
    }
}

#[test]
fn files_that_are_learned_together_may_have_their_columns_in_any_order() {
    let place = Place::with(&experiment("files = [\"arm.csv\", \"swapped.csv\"]"));
    place.write("arm.csv", table(["shoulder", "elbow"], [0, 1]));
    place.write("swapped.csv", table(["shoulder", "elbow"], [1, 0]));
    place.ok("train sine.toml --out run");
    place.write("same.csv", table(["shoulder", "elbow"], [0, 1]));
    place.ok("train sine.toml --out same --set data.files=[\"arm.csv\",\"same.csv\"]");
    let nll = |run: &str| place.json(&format!("inspect {run} --json"))["score"]["nll"].as_f64().unwrap();
    assert_eq!(nll("run").to_bits(), nll("same").to_bits());
    // A file without a header is taken by position, and that is said.
    let rows = table(["shoulder", "elbow"], [0, 1]).split_once('\n').unwrap().1.to_owned();
    place.write("nameless.csv", rows);
    let output = place.run("train sine.toml --out other --set data.files=[\"arm.csv\",\"nameless.csv\"]");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && told.contains("warning") && told.contains("nameless.csv"), "{told}");
    // Other names are refused.
    place.write("others.csv", table(["knee", "hip"], [0, 1]));
    let (_, told) = place.fails(2, "train sine.toml --out third --set data.files=[\"arm.csv\",\"others.csv\"]");
    assert!(told.contains("need the same channels, by the same names"), "{told}");
}
