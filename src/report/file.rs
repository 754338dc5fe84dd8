//! Files that are whole or not there.

use crate::error::Error;
use std::fs;
use std::path::Path;

/// Writes beside `path`, then renames; what cannot be finished is removed.
pub(super) fn write(path: &Path, content: &[u8]) -> Result<(), Error> {
    let failed = |source: std::io::Error| Error::File { path: path.to_owned(), source: source.into() };
    // A pipe or a device is written to as it stands.
    if path.exists() && !path.is_file() {
        return fs::write(path, content).map_err(failed);
    }
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let written = fs::write(&beside, content).and_then(|()| fs::rename(&beside, path));
    written.map_err(|source| {
        // The error to report is that of writing, not one of removing the partial file.
        let _ = fs::remove_file(&beside);
        failed(source)
    })
}
