//! Records: valid by construction, from files, cut and filtered.

mod bad_records;
mod csv;
mod edits;
mod inspect;
mod npy;
#[path = "../common/shared.rs"]
mod shared;
mod valid;
