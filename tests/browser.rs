//! A page in a real browser without a window: figures visible in light, in dark and on a phone, no request, no message on
//! the console.
//!
//! It needs Python with playwright (SCRNN_PYTHON, else the one in .venv, which .ci/run makes) and a Chromium, as
//! tests/python/look_at_page.py finds it. Without a browser the test says that it was skipped.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The script's exit code where there is no browser.
const NO_BROWSER: i32 = 3;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn skipped(why: &str) {
    // Past the test harness, which shows nothing of a test that passes.
    writeln!(std::io::stderr().lock(), "skipped: {why}; .ci/run gets what is needed").unwrap();
}

/// An interpreter with playwright.
fn python() -> Option<PathBuf> {
    let venv = if cfg!(windows) { ".venv/Scripts/python.exe" } else { ".venv/bin/python" };
    let python = std::env::var_os("SCRNN_PYTHON").map_or_else(|| root().join(venv), PathBuf::from);
    match Command::new(&python).args(["-c", "import playwright.sync_api"]).output() {
        Ok(output) if output.status.success() => Some(python),
        _ => {
            let message = format!("no Python with playwright: {}", python.display());
            assert!(std::env::var_os("CI").is_none(), "{message}");
            skipped(&message);
            None
        }
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn scrnn(folder: &Path, line: &str) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_scrnn")).current_dir(folder).args(line.split_whitespace()).output().unwrap();
    assert!(output.status.success(), "scrnn {line}\n{}", text(&output.stderr));
}

/// What the browser says of a page; none if there is no browser.
fn look(python: &Path, page: &Path) -> Option<Output> {
    let script = root().join("tests/python/look_at_page.py");
    let output = Command::new(python).arg(script).arg(page).output().unwrap();
    if output.status.code() == Some(NO_BROWSER) {
        skipped(text(&output.stderr).trim());
        return None;
    }
    Some(output)
}

#[test]
fn pages_open_in_a_browser_without_error_request_or_hidden_figure() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    scrnn(folder.path(), "reproduce limit-cycle --epochs 20 --out cycle");
    scrnn(folder.path(), "report cycle/seed-1");
    let sweep = format!(
        "name = \"two\"\nexperiment = {:?}\nseeds = 2\n[set]\ntraining.epochs = 20\n[grid]\n\"training.adam.rate\" = [1e-3, 1e-2]\n\
         \"network.groups.context.units\" = [3, 4, 5]\n",
        root().join("assets/experiments/sinusoid_fast.toml")
    );
    std::fs::write(folder.path().join("two.toml"), sweep).unwrap();
    scrnn(folder.path(), "sweep two.toml --out two");
    scrnn(folder.path(), "compare two");
    for (name, figures) in [("cycle", 4), ("cycle/seed-1", 5), ("two", 7)] {
        let page = folder.path().join(name).join("report.html");
        let Some(output) = look(&python, &page) else { return };
        let said = text(&output.stdout);
        assert!(output.status.success(), "{name}\n{said}{}", text(&output.stderr));
        assert!(said.starts_with(&format!("{figures} figures")), "{said}");
    }

    // The look is worth something: a page with a script that fails, a picture from elsewhere and a figure without extent
    // does not pass.
    let bad = folder.path().join("bad.html");
    let html =
        "<script>throw new Error('x')</script><img src='missing.png'><figure id='f'><svg width='0'></svg></figure>";
    std::fs::write(&bad, html).unwrap();
    let Some(output) = look(&python, &bad) else { return };
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    for part in ["light: error: x", "asks for", "f is not visible"] {
        assert!(said.contains(part), "{part} is missing in\n{said}");
    }
}
