//! Two files that a command writes, or one that it writes and one that it reads, must not be the same.

use std::path::Path;

use scrnn_data::{expand, is_one_file};
use scrnn_run::failure::{Failure, Result};
use scrnn_run::run_folder::FILES;

/// A file on the command line: how it was given, and where it is.
pub type Named<'a> = (&'static str, Option<&'a Path>);

/// Refuses outputs that are each other or an input: a file, one of a folder or of a pattern, or what a run folder holds.
///
/// # Errors
/// [`Failure::Refused`] with the two options.
pub fn check_distinct(outputs: &[Named<'_>], inputs: &[Named<'_>]) -> Result<()> {
    let given = |files: &[Named<'_>]| files.iter().filter_map(|&(name, path)| Some((name, path?.to_owned()))).collect();
    let (outputs, mut inputs): (Vec<_>, Vec<_>) = (given(outputs), given(inputs));
    for (name, path) in inputs.clone() {
        // What cannot be found is told of by who reads it.
        inputs.extend(expand(&path).unwrap_or_default().into_iter().map(|file| (name, file)));
        inputs.extend(FILES.map(|file| (name, path.join(file))).into_iter().filter(|(_, file)| file.exists()));
    }
    for (k, (name, path)) in outputs.iter().enumerate() {
        if let Some((other, _)) = outputs[..k].iter().chain(&inputs).find(|(_, other)| is_one_file(path, other)) {
            let message = format!("{other} and {name} are one file: {}", path.display());
            return Err(Failure::refused(message, "one would be lost: give another file"));
        }
    }
    Ok(())
}
