//! Checkpoints and histories that somebody made to do harm: what they note is checked before it is believed.

use scrnn::checkpoint::Checkpoint;
use serde_json::{Value, json};

use super::{Place, SINE};

const RUN: &str = "run/checkpoint.safetensors";

/// A run whose checkpoint notes something else.
fn noting(place: &Place, change: impl Fn(&mut Value)) {
    let mut checkpoint = Checkpoint::from_bytes(&place.read("whole.safetensors")).unwrap();
    change(&mut checkpoint.notes);
    place.write(RUN, checkpoint.to_bytes().unwrap());
}

fn trained() -> Place {
    let place = Place::with(SINE);
    place.ok("train sine.toml --out run --epochs 20 -q");
    place.write("whole.safetensors", place.read(RUN));
    place
}

/// Runs a line of a crafted run: it ends by itself and within memory, with one of the codes, and says what is expected.
fn ends(place: &Place, line: &str, codes: &[i32], expected: &str) {
    // 4 GB of addresses: what is refused is refused before it is tried.
    let script = format!("ulimit -v 4000000; exec \"$0\" {line}");
    let mut command = std::process::Command::new("sh");
    let program = env!("CARGO_BIN_EXE_scrnn");
    let output = command.args(["-c", &script, program]).current_dir(&place.0).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).replace('\u{2502}', " ");
    let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(output.status.code().is_some_and(|code| codes.contains(&code)), "{line}: {:?}, {told}", output.status);
    assert!(!told.contains("panicked") && told.contains(expected), "{line}: {told}");
}

#[test]
fn lengths_without_bound_in_notes_are_refused_with_the_amount() {
    let place = trained();
    for length in [1_u64 << 63, u64::MAX, 1 << 40, 1 << 31] {
        noting(&place, |notes| notes["data"]["lengths"] = json!([length]));
        for line in ["generate run", "generate run --mean", "generate run --samples 1000000"] {
            ends(&place, line, &[2], "needs ");
        }
        // Whoever says how many gets them.
        ends(&place, "generate run --steps 3", &[0], "");
        ends(&place, "inspect run", &[0], "");
        ends(&place, "train sine.toml --out run --epochs 20 --resume", &[5], "samples in each sequence");
    }
    for lengths in [json!([0]), json!([]), json!(null), json!([-1]), json!(["80"]), json!([1.5]), json!([80, 80])] {
        noting(&place, |notes| notes["data"]["lengths"] = lengths.clone());
        ends(&place, "generate run", &[0, 2], "");
        ends(&place, "train sine.toml --out run --epochs 20 --resume", &[5], "run");
    }
    noting(&place, |notes| notes["data"]["lengths"] = vec![1; 100_000].into());
    ends(&place, "train sine.toml --out run --epochs 20 --resume", &[5], "and 99980 more");
}

#[test]
fn experiments_in_notes_are_checked_as_those_in_files() {
    let place = trained();
    let data =
        |key: &'static str, value: Value| move |notes: &mut Value| notes["experiment"]["data"][key] = value.clone();
    for (key, value, expected) in [
        ("steps", json!(u64::MAX), "at most 1e9"),
        ("steps", json!(1_000_000_001_u64), "at most 1e9"),
        ("sequences", json!(1_000_001), "at most 1e6"),
        ("steps", json!(0), "at least 1"),
        ("task", json!("none"), "unknown variant"),
        ("nonsense", json!(1), "unknown field"),
        ("files", json!(["/dev/zero"]), "both `task` and `files`"),
    ] {
        noting(&place, data(key, value));
        ends(&place, "generate run --mode open", &[2], expected);
        ends(&place, "report run", &[0, 2], "");
        ends(&place, "train sine.toml --out run --epochs 20 --resume", &[5], expected);
    }
    // A task that would fill most of the memory.
    noting(&place, |notes| {
        notes["experiment"]["data"]["steps"] = json!(1_000_000_000);
        notes["experiment"]["data"]["sequences"] = json!(1_000_000);
    });
    ends(&place, "generate run --mode open", &[2], "needs");
    // Keys within keys, each longer than a line, and many below them.
    let mut deep: Value = (0..3000).map(|k| (format!("k{k}"), json!(k))).collect::<serde_json::Map<_, _>>().into();
    for _ in 0..60 {
        deep = json!({ "a".repeat(500): deep });
    }
    noting(&place, |notes| notes["experiment"]["data"] = deep.clone());
    ends(&place, "train sine.toml --out run --epochs 20 --resume", &[5], "cannot be read");
    noting(&place, |notes| *notes = deep.clone());
    ends(&place, "train sine.toml --out run --epochs 20 --resume", &[5], "not written by `scrnn train`");
    ends(&place, "inspect run --json", &[0], "");
    ends(&place, "generate run", &[2], "the number of steps");
}

#[test]
fn scores_and_names_in_notes_are_shown_and_do_no_harm() {
    let place = trained();
    for (key, value) in [
        ("score", json!({ "epoch": u64::MAX, "nll": -1e308, "mse": 1e308 })),
        ("best", json!({ "epoch": u64::MAX, "mse": -1e308 })),
        ("best", json!({ "epoch": 20, "nll": null, "mse": 0 })),
        ("best", json!("best")),
    ] {
        noting(&place, |notes| notes[key] = value.clone());
        ends(&place, "inspect run", &[0], "");
        ends(&place, "report run", &[0, 2], "");
        ends(&place, "train sine.toml --out run --epochs 30 --resume", &[0, 5], "");
    }
    noting(&place, |notes| notes["experiment"]["name"] = json!("\u{1b}]0;pwn\u{7}<script>\u{202e}"));
    place.ok("report run");
    let page = place.text("run/report.html");
    assert!(!page.contains("pwn\u{7}<script>") && !page.contains('\u{1b}'));
    noting(&place, |notes| notes["experiment"]["training"]["optimiser"] = json!("\u{1b}[31m\u{202e}"));
    for line in ["inspect run", "inspect run --json"] {
        let seen = place.ok(line);
        assert!(!seen.contains(['\u{1b}', '\u{7}', '\u{202e}']) && seen.contains("[31m"), "{seen:?}");
    }
    let seen = place.json("inspect run --json");
    assert_eq!(seen["experiment"]["training"]["optimiser"], "\u{1b}[31m\u{202e}");
    ends(&place, "report run", &[2], "unknown variant");
}

#[test]
fn histories_that_go_wild_are_cut_with_a_word_and_drawn() {
    let place = trained();
    let row = |epoch: u64, rest: &str| format!("{epoch},{rest}\n");
    let head = "epoch,nll,mse,rate_shared,rate_initial,gradient_norm,seconds,recoveries\n";
    for (rows, damaged) in [
        (row(0, "1e308,1e308,1e308,1e308,1e308,0.1,0") + &row(1, "-1e308,5e-324,1,1,1,0.2,0"), false),
        (row(0, "inf,nan,nan,nan,inf,0.1,0") + &row(1, "nan,inf,1,1,1,0.2,0"), false),
        (row(0, "1,1,1,1,1,inf,0"), true),
        (row(0, "1,1,1,1,1,-5,0"), true),
        (row(5, "1,1,1,1,1,1,0") + &row(3, "1,1,1,1,1,2,0"), true),
        (row(5, "1,1,1,1,1,1,18446744073709551615"), false),
        (row(u64::MAX, "1,1,1,1,1,1,0") + &row(3, "1,1,1,1,1,2,0"), true),
        ("\0\0\0\n".to_owned(), true),
    ] {
        place.write("run/history.csv", format!("{head}{rows}"));
        place.write(RUN, place.read("whole.safetensors"));
        place.ok("report run");
        let output = place.run("train sine.toml --out run --epochs 40 --resume");
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && told.contains("is damaged") == damaged, "{rows}: {told}");
        place.ok("report run");
        let epochs = super::epochs(&place.text("run/history.csv"));
        assert!(epochs.last() == Some(&40) && epochs.windows(2).all(|pair| pair[0] < pair[1]), "{rows}: {epochs:?}");
    }
}
