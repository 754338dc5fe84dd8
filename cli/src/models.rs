//! `models`: those that ship.

use crate::arguments::Models;
use crate::fitting::shipped;
use crate::{Failure, Verdict, output};
use greybox::text::{self, Model};

pub fn run(one: &Models) -> Result<Verdict, Failure> {
    if let Some(name) = &one.name {
        output::line(shipped(name)?)?;
        return Ok(Verdict::Usable);
    }
    let width = text::shipped().iter().map(|one| one.name.len()).max().unwrap_or(0);
    for one in text::shipped() {
        output::line(format!("{:width$}  {}", one.name, Model::named(one.name, one.text)?.name()))?;
    }
    Ok(Verdict::Usable)
}
