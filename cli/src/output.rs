//! Results: files that are whole or not there, and standard output.

use crate::Failure;
use crate::project::FILE;
use crate::remedies::in_shell;
use greybox::{Report, Summary};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What a report may be written as.
pub const REPORTS: [&str; 4] = ["html", "md", "json", "txt"];
/// What a record may be written as: what is read again.
pub const RECORDS: [&str; 1] = ["csv"];

/// Writes beside the file first and then renames, so that there is never half a file; without a path, to standard output.
pub fn write(path: Option<&Path>, content: &[u8]) -> Result<(), Failure> {
    let Some(path) = path else { return print(content) };
    let path = &target(path);
    let failed = |error: std::io::Error| format!("{}: {error}", path.display());
    // A pipe or a device is written to as it stands.
    if path.exists() && !path.is_file() {
        return Ok(std::fs::write(path, content).map_err(failed)?);
    }
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let written = std::fs::write(&beside, content).and_then(|()| std::fs::rename(&beside, path));
    Ok(written.map_err(|error| {
        // The error to report is that of writing, not one of removing the part.
        let _ = std::fs::remove_file(&beside);
        failed(error)
    })?)
}

/// Where a path leads: a link stays a link, and what it leads to is written.
pub fn target(path: &Path) -> PathBuf {
    // What is not there yet has no other path than that of its folder, and a pipe has none.
    let in_folder = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(folder.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

/// Writes a report as the path's ending says, one of [`REPORTS`].
pub fn report(path: &Path, report: &Report) -> Result<(), Failure> {
    let text = match ending(path).as_str() {
        "html" => in_shell(&report.to_html()),
        "md" => in_shell(&report.to_markdown()),
        "json" => report.to_json()?,
        _ => in_shell(&report.to_string()),
    };
    write(Some(path), text.as_bytes())
}

/// Checks before a fit that a file can be written after it: its folder is there, and its ending is one of these, if any are given.
pub fn check(path: Option<&Path>, endings: &[&str]) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    let ending = ending(path);
    if let Some((last, before)) = endings.split_last().filter(|_| !endings.contains(&ending.as_str())) {
        let before = if before.is_empty() { String::new() } else { format!(".{} or ", before.join(", .")) };
        return Err(
            format!("{}: files that end in .{ending} are not written; take {before}.{last}", path.display()).into()
        );
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    match folder.is_none_or(Path::is_dir) && !path.is_dir() {
        true => Ok(()),
        false => Err(format!("{}: there is no such folder, or a folder has this name", path.display()).into()),
    }
}

/// Checks before a fit that what a command writes takes the place neither of what it reads nor of another result.
pub fn apart<'a>(
    written: impl IntoIterator<Item = &'a Option<PathBuf>>,
    read: impl IntoIterator<Item = PathBuf>,
) -> Result<(), Failure> {
    let read: Vec<PathBuf> = read.into_iter().chain([PathBuf::from(FILE)]).map(|path| target(&path)).collect();
    let mut others: Vec<PathBuf> = vec![];
    for path in written.into_iter().flatten() {
        let at = target(path);
        // To a pipe or a device any number of results may go.
        let is_file = !at.exists() || at.is_file();
        if is_file && read.contains(&at) {
            return Err(format!("{}: this command reads it; name another file for the result", path.display()).into());
        }
        if is_file && others.contains(&at) {
            return Err(format!("{}: two results would go there; name two files", path.display()).into());
        }
        others.push(at);
    }
    Ok(())
}

/// Prints. A reader that has seen enough, such as `head`, is no error.
pub fn print(content: &[u8]) -> Result<(), Failure> {
    match std::io::stdout().write_all(content).and_then(|()| std::io::stdout().flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(format!("standard output: {error}").into()),
        _ => Ok(()),
    }
}

/// Prints a text, remedies in the words of the command line, and ends its line.
pub fn line(text: impl std::fmt::Display) -> Result<(), Failure> {
    print(format!("{}\n", in_shell(text.to_string().trim_end())).as_bytes())
}

/// Prints an estimate. Its warnings are in the words of the command line before lines are wrapped, which may part the words of a remedy.
pub fn estimate(found: &Summary) -> Result<(), Failure> {
    let mut said = found.clone();
    said.warnings.iter_mut().for_each(|warning| warning.text = in_shell(&warning.text));
    line(said)
}

/// The ending of a path, in small letters.
pub fn ending(path: &Path) -> String {
    path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default()
}
