//! Records: valid by construction, from files, cut and filtered.

mod bad_records;
mod columns;
mod csv;
mod dates;
mod edits;
mod guesses;
mod inspect;
mod made;
mod npy;
mod pmsm;
mod rates;
#[path = "../common/refused.rs"]
mod refused;
#[path = "../common/shared.rs"]
mod shared;
mod time_units;
mod valid;
