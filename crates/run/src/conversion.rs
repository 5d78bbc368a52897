//! Data from one kind of file to another, with nothing lost on the way: not the data that were there before either.

use std::path::{Path, PathBuf};

use scrnn_data::{Conversion, FileError, Level, Reading, Selection, is_one_file, read_all, write_converted};

use crate::failure::{Failure, Result};
use crate::messages::Messages;

/// Reads what `input` names (a file, a folder, a pattern) and writes it to `output`, in the format of that name. The period of
/// the selection is told to data that have no clock. Returns the files that were written.
///
/// # Errors
/// [`Failure::Refused`] if an input would be lost, or a folder that is in use; what is wrong with the data.
pub fn convert(
    input: &Path,
    output: &Path,
    selection: &Selection,
    task: Option<&str>,
    messages: &dyn Messages,
) -> Result<Vec<PathBuf>> {
    let reading = match read_all(&[input], selection) {
        // Nobody knows when they were taken; the one who asks does.
        Err(FileError::NoClock { .. }) if selection.period.is_some() => {
            let without = Selection { period: None, ..selection.clone() };
            Reading { period: selection.period, ..read_all(&[input], &without)? }
        }
        other => other?,
    };
    refuse_harm(input, &reading.facts.files, output)?;
    for remark in &reading.remarks {
        let kind = if remark.level() == Level::Warning { "warning" } else { "note" };
        messages.say(&format!("{kind}: {remark}"));
    }
    let about = Conversion { period: reading.period, task };
    Ok(write_converted(output, &reading.data, &about)?)
}

/// Refuses to write over what is read, or into a folder that holds something.
fn refuse_harm(input: &Path, files: &[String], output: &Path) -> Result<()> {
    let lost = |path: &Path| {
        let message = format!("{} is read from: it would be lost, or mixed with what is written", path.display());
        Err(Failure::refused(message, "write to another place"))
    };
    let whole = |path: &Path| std::fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    for path in files.iter().map(Path::new).chain([input]) {
        if is_one_file(path, output) {
            return lost(path);
        }
        // A folder within what is read, or what is read within a folder.
        if let (Ok(read), Ok(written)) = (whole(path), whole(output))
            && (written.is_dir() || path.is_dir() && output.extension().is_none())
            && (read.starts_with(&written) || written.starts_with(&read))
        {
            return lost(path);
        }
    }
    let holds = |folder: &Path| std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if output.is_dir() && holds(output) {
        let message = format!("the folder {} holds something already", output.display());
        return Err(Failure::refused(message, "give the name of a folder that is not there yet"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    struct Silent;

    impl Messages for Silent {
        fn say(&self, _: &str) {}
    }

    const TABLE: &str =
        "sequence,left,right\nbig swing,1,2.5\nbig swing,0.1,-3\nbig swing,0.2,-3\nrest,4,5\nrest,4,5.5\nrest,4.5,5\n";

    #[test]
    fn names_and_values_go_through_every_format_and_back() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.csv"), TABLE).unwrap();
        let first = read_all(&[at("a.csv")], &Selection::default()).unwrap().data;
        let with_period = Selection { period: Some(0.02), ..Selection::default() };
        for (step, name) in ["b.npz", "c.tsv", "d.txt", "e.mcap", "f.csv"].into_iter().enumerate() {
            let from = ["a.csv", "b.npz", "c.tsv", "d.txt", "e.mcap"][step];
            let selection = if name == "e.mcap" { &with_period } else { &Selection::default() };
            convert(&at(from), &at(name), selection, None, &Silent).unwrap();
            let data = read_all(&[at(name)], &Selection::default()).unwrap().data;
            assert_eq!(data, first, "{name}");
        }
        // LeRobot calls all that is not an action a state.
        convert(&at("a.csv"), &at("set"), &with_period, Some("swing"), &Silent).unwrap();
        let reading = read_all(&[at("set")], &Selection::default()).unwrap();
        assert_eq!(reading.data.channels(), ["observation.state.left", "observation.state.right"]);
        assert_eq!(reading.data.sequences(), first.sequences());
        assert_eq!(reading.period, Some(0.02));
    }

    #[test]
    fn what_is_read_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("in")).unwrap();
        fs::write(at("in/a.csv"), TABLE).unwrap();
        let selection = Selection { period: Some(0.02), ..Selection::default() };
        let refused = |input: &str, output: &str| {
            let failure = convert(&at(input), &at(output), &selection, None, &Silent).unwrap_err();
            assert_eq!(failure.code(), 5, "{failure}");
            failure.to_string()
        };
        assert!(refused("in/a.csv", "in/a.csv").contains("is read from"));
        assert!(refused("in", "in/a.csv").contains("is read from"));
        assert!(refused("in", "in").contains("is read from"));
        assert!(refused("in/a.csv", "in").contains("is read from"));
        assert!(refused("in", "in/set").contains("is read from"));
        fs::create_dir(at("other")).unwrap();
        fs::write(at("other/x"), "").unwrap();
        assert!(refused("in/a.csv", "other").contains("holds something"));
        assert_eq!(fs::read_to_string(at("in/a.csv")).unwrap(), TABLE);
        // Beside it is fine.
        convert(&at("in/a.csv"), &at("in/b.npz"), &Selection::default(), None, &Silent).unwrap();
        // Who does not know the period is asked for it.
        let error = convert(&at("in/a.csv"), &at("c.mcap"), &Selection::default(), None, &Silent).unwrap_err();
        assert!(error.to_string().contains("nothing tells how many seconds"), "{error}");
    }
}
