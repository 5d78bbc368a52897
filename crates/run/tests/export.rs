//! One step as C beside the library's own: every kind of network, hundreds of steps, with gaps.
//!
//! Where there is no C compiler the tests say that they were skipped; where CI is set, they fail.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use scrnn::checkpoint::Checkpoint;
use scrnn_run::export::{OneStep, Precision};
use scrnn_run::trained::Trained;

mod variants;

use variants::{STEPS, Variant, greatest_difference};

const STRICT: [&str; 6] = ["-Wall", "-Wextra", "-pedantic", "-Wshadow", "-Werror", "-O2"];

/// Whether there is a compiler of this name.
fn has(compiler: &str) -> bool {
    if Command::new(compiler).arg("--version").output().is_ok_and(|output| output.status.success()) {
        return true;
    }
    assert!(std::env::var_os("CI").is_none(), "no {compiler} here");
    writeln!(std::io::stderr().lock(), "skipped: no {compiler} here").unwrap();
    false
}

fn succeeded(output: Output, what: &str) -> Output {
    assert!(output.status.success(), "{what}\n{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn compile(compiler: &str, standard: &str, folder: &Path, arguments: &[&str]) {
    let mut command = Command::new(compiler);
    command.current_dir(folder).arg(standard).args(STRICT).args(arguments);
    succeeded(command.output().unwrap(), &format!("{compiler} {standard} {arguments:?} in {}", folder.display()));
}

/// The program that stands in the comment at the top of a file.
fn example(text: &str) -> String {
    let comment = text.lines().take_while(|line| *line != " */");
    let own = comment.skip_while(|line| *line != " *     #include <stdio.h>");
    own.map(|line| line.strip_prefix(" *     ").unwrap_or_default().to_owned() + "\n").collect()
}

/// What the compiled example answers, line by line.
fn answers(program: &Path, samples: &[f64]) -> String {
    let mut child = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let text: String = samples.iter().map(|x| format!("{x:e}\n").to_lowercase()).collect();
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    String::from_utf8(succeeded(child.wait_with_output().unwrap(), "the example").stdout).unwrap()
}

fn c_of(variant: &Variant) -> String {
    OneStep::of(&variant.all, variant.sequence).unwrap().c()
}

#[test]
fn the_c_file_computes_what_the_library_computes_for_every_kind_of_network() {
    if !has("cc") {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    for variant in variants::all(place.path()) {
        let text = c_of(&variant);
        // Nothing that changes, and no memory to ask for.
        let fixed = |line: &str| ["static const ", "static inline "].iter().any(|start| line.trim().starts_with(start));
        assert!(text.lines().filter(|line| line.trim().starts_with("static")).all(fixed), "{}", variant.name);
        assert!(text.is_ascii() && !text.contains("alloc"));
        std::fs::write(variant.run.join("network.h"), &text).unwrap();
        std::fs::write(variant.run.join("example.c"), example(&text)).unwrap();
        compile("cc", "-std=c99", &variant.run, &["example.c", "-o", "example", "-lm"]);
        let out = answers(&variant.run.join("example"), &variant.samples);
        let has_variance = !variant.variance.is_empty();
        let (mut mean, mut variance) = (Vec::new(), Vec::new());
        // A name may hold whatever it likes, a line break as well: numbers stand at the ends of lines.
        for line in out.lines().filter(|line| !line.starts_with("elbow")) {
            let mut numbers = line.rsplit(' ').map(|number| number.parse::<f64>().unwrap());
            if has_variance {
                variance.extend(numbers.next());
            }
            mean.extend(numbers.next());
        }
        let (of_means, of_variances) = greatest_difference(&variant, &mean, &variance, STEPS);
        println!("{}: means {of_means:.1e}, variances {of_variances:.1e}", variant.name);
        assert!(of_means <= 1e-12 && of_variances <= 1e-12, "{}: {of_means:e}, {of_variances:e}", variant.name);
    }
}

#[test]
fn the_c_file_stands_alone_and_is_cpp_as_well() {
    if !has("cc") || !has("c++") {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    for variant in variants::all(place.path()) {
        std::fs::write(variant.run.join("alone.c"), c_of(&variant)).unwrap();
        compile("cc", "-std=c99", &variant.run, &["-c", "alone.c", "-o", "alone.o"]);
        compile("cc", "-std=c11", &variant.run, &["-Wconversion", "-c", "alone.c", "-o", "alone.o"]);
        std::fs::copy(variant.run.join("alone.c"), variant.run.join("alone.cpp")).unwrap();
        compile("c++", "-std=c++11", &variant.run, &["-c", "alone.cpp", "-o", "alone.o"]);
    }
    let fast = ["-std=c99", "-ffast-math", "-c", "s_ctrnn/alone.c", "-o", "alone.o"];
    let refused = Command::new("cc").current_dir(place.path()).args(fast).output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("compile without -ffast-math"));
}

/// The blocks of a language in docs/robots.md.
fn shown(language: &str) -> Vec<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/robots.md")).unwrap();
    let fence = format!("```{language}\n");
    text.split(&fence).skip(1).map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

#[test]
fn the_loop_in_the_document_compiles_and_runs() {
    if !has("cc") {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let variant = variants::all(place.path()).into_iter().find(|one| one.name == "s_ctrnn").unwrap();
    let blocks = shown("c");
    let [whole, ahead] = blocks.as_slice() else { panic!("{} blocks of C", blocks.len()) };
    // The robot: five samples, and what is sent to it counted. The look ahead stands where the loop ends.
    let robot = "\n#include <stdio.h>\n\nstatic int count = 0;\n\nint read_sensors(double sample[SCRNN_CHANNELS])\n{\n    \
                 sample[0] = 1200.0 + count;\n    sample[1] = NAN;\n    return count < 5;\n}\n\n\
                 void send_command(const double mean[SCRNN_CHANNELS], const double deviation[SCRNN_CHANNELS])\n{\n    \
                 ++count;\n    printf(\"%.17g %.17g\\n\", mean[0], deviation[0]);\n}\n";
    let (main, end) = whole.rsplit_once("    return 0;\n").unwrap();
    let inner: String = ahead.lines().map(|line| format!("    {line}\n")).collect();
    let program =
        format!("{main}    {{\n{inner}    send_command(mean, deviation);\n    }}\n    return 0;\n{end}{robot}");
    std::fs::write(variant.run.join("network.h"), c_of(&variant)).unwrap();
    std::fs::write(variant.run.join("loop.c"), program).unwrap();
    compile("cc", "-std=c99", &variant.run, &["loop.c", "-o", "loop", "-lm"]);
    let started = std::time::Instant::now();
    let out = succeeded(Command::new(variant.run.join("loop")).output().unwrap(), "the loop");
    assert!(started.elapsed().as_millis() >= 90, "five steps at 50 Hz");
    let numbers: Vec<f64> =
        String::from_utf8(out.stdout).unwrap().split_whitespace().map(|number| number.parse().unwrap()).collect();
    let samples: Vec<f64> =
        (0..30).flat_map(|k| [if k < 5 { 1200.0 + f64::from(k) } else { f64::NAN }, f64::NAN]).collect();
    let (mean, variance) = variants::predicted(&variant.all, variant.sequence, &samples);
    for k in 0..5 {
        let (y, deviation) = (numbers[2 * k], numbers[2 * k + 1]);
        assert!((y - mean[2 * k]).abs() < 1e-9, "step {k}");
        assert!((deviation.powi(2) / variance[2 * k] - 1.0).abs() < 1e-9, "step {k}");
    }
    // 25 steps beyond the fifth.
    assert_eq!(numbers.len(), 12);
    assert!((numbers[10] - mean[2 * 29]).abs() < 1e-9, "{} instead of {}", numbers[10], mean[58]);
}

#[test]
fn names_of_channels_come_out_as_they_are() {
    if !has("cc") {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let variant = variants::all(place.path()).into_iter().find(|one| one.name == "s_mtrnn").unwrap();
    let program = "#include <stdio.h>\n#include \"network.h\"\nint main(void)\n{\n    int i;\n\n    for (i = -1; i <= SCRNN_CHANNELS; ++i)\n        printf(\"<%s>\", scrnn_channel(i));\n    return 0;\n}\n";
    std::fs::write(variant.run.join("network.h"), c_of(&variant)).unwrap();
    std::fs::write(variant.run.join("names.c"), program).unwrap();
    compile("cc", "-std=c99", &variant.run, &["names.c", "-o", "names", "-lm"]);
    let output = Command::new(variant.run.join("names")).output().unwrap();
    let names: String = variant.all[0].checkpoint.channels.iter().map(|name| format!("<{name}>")).collect();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), format!("<>{names}<>"));
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let (one, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for (a, b) in variants::all(one.path()).iter().zip(&variants::all(other.path())) {
        assert_eq!(c_of(a), c_of(b), "{}", a.name);
        let [from_a, from_b] = [a, b].map(|variant| OneStep::of(&variant.all, variant.sequence).unwrap());
        for precision in [Precision::Float64, Precision::Float32] {
            assert_eq!(from_a.onnx(precision).unwrap(), from_b.onnx(precision).unwrap(), "{}", a.name);
        }
        assert_ne!(from_a.onnx(Precision::Float64).unwrap(), from_a.onnx(Precision::Float32).unwrap());
    }
}

#[test]
fn the_state_begins_where_it_was_told_to() {
    let place = tempfile::tempdir().unwrap();
    let variant = variants::all(place.path()).into_iter().find(|one| one.name == "s_ctrnn").unwrap();
    let of = |sequence: Option<&str>| OneStep::of(&variant.all, sequence).unwrap().c();
    assert_eq!(of(None), of(Some("mean")));
    assert!(of(None).contains("The state begins from the mean of the learned initial states."));
    assert!(of(Some("right/2")).contains("The state begins from the initial state of the learned sequence right/2."));
    assert_eq!(of(Some("2")), of(Some("right/2")));
    assert_ne!(of(Some("left")), of(Some("right/2")));
    let refused = OneStep::of(&variant.all, Some("nod")).unwrap_err();
    assert_eq!((refused.code(), refused.to_string().as_str()), (2, "there is no learned sequence nod"));
}

#[test]
fn members_of_different_kinds_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let mut all = Vec::new();
    for variant in variants::all(place.path()) {
        if matches!(variant.name, "s_ctrnn" | "robust_scaling" | "delay") {
            all.extend(variant.all);
        }
    }
    for pair in [[0, 1], [0, 2]] {
        let open = |k: usize| Trained::open(&all[k].path, false).unwrap();
        let refused = OneStep::of(&[open(pair[0]), open(pair[1])], None).unwrap_err();
        assert!(refused.to_string().starts_with("member 2 is not of the same kind"), "{refused}");
    }
    assert_eq!(OneStep::of(&[], None).unwrap_err().code(), 2);
}

#[test]
fn what_float32_cannot_hold_is_refused() {
    let place = tempfile::tempdir().unwrap();
    let refused = |offset: f64, scale: f64, weight: f64| {
        let variant = variants::all(place.path()).into_iter().find(|one| one.name == "one_channel").unwrap();
        let path = variant.run.join("checkpoint.safetensors");
        let mut checkpoint = Checkpoint::from_bytes(&std::fs::read(&path).unwrap()).unwrap();
        checkpoint.scaling = scrnn::Scaling::new(vec![offset], vec![scale]).unwrap();
        checkpoint.parameters.as_mut_slice()[0] = weight;
        std::fs::write(&path, checkpoint.to_bytes().unwrap()).unwrap();
        let step = OneStep::of(&[Trained::open(&path, false).unwrap()], None).unwrap();
        assert!(step.onnx(Precision::Float64).is_ok());
        step.onnx(Precision::Float32).map(|_| ()).map_err(|failure| failure.to_string())
    };
    assert_eq!(refused(1200.0, 0.01, 1.0), Ok(()));
    // Seconds since 1970: float32 knows them to two minutes.
    assert!(refused(1.7e9, 0.1, 1.0).unwrap_err().contains("float32 rounds its samples by"));
    assert!(refused(0.0, 1e-25, 1.0).unwrap_err().contains("out of float32's range"));
    assert!(refused(0.0, 1.0, 1e40).unwrap_err().contains("out of float32's range"));
}
