//! The folder of a sweep of a thousand networks, without training them: one network stands for all. What a page shows does not depend on
//! how long they learned.

use std::fs;
use std::path::Path;

use serde_json::Value;

/// Ten seeds of a hundred rates.
const SWEEP: &str = "name = \"s\"\nexperiment = \"sine.toml\"\nseeds = 10\n[grid]\n\
                     \"training.adam.rate\" = { from = 1e-4, to = 1e-1, count = 100, scale = \"log\" }\n";

/// Makes it as `runs/s` in a folder that holds `sine.toml`; `scrnn` runs a command there, and gives what it prints.
pub fn make(folder: &Path, scrnn: &dyn Fn(&str) -> String) {
    fs::write(folder.join("s.toml"), SWEEP).unwrap();
    let plan = scrnn("sweep s.toml --dry-run --json");
    let sweep = folder.join("runs/s");
    fs::create_dir_all(&sweep).unwrap();
    fs::write(sweep.join("plan.json"), &plan).unwrap();
    scrnn("train sine.toml --out one --quiet");
    let plan: Value = serde_json::from_str(&plan).unwrap();
    for (k, run) in plan["runs"].as_array().unwrap().iter().enumerate() {
        let run = sweep.join(run["folder"].as_str().unwrap());
        fs::create_dir_all(&run).unwrap();
        for name in ["checkpoint.safetensors", "history.csv"] {
            fs::copy(folder.join("one").join(name), run.join(name)).unwrap();
        }
        fs::write(run.join("report.html"), "").unwrap();
        let value = (k * 7919 % 1000) as f64 / 1000.0;
        let text = format!(
            "{{\"format\":1,\"outcome\":\"finished\",\"decided_by\":\"\",\"measures\":{{\"nll\":{value},\"mse\":{value},\"best.nll\":{value},\"epoch\":200}}}}"
        );
        fs::write(run.join("outcome.json"), text).unwrap();
    }
}
