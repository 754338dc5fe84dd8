//! `completions` and `man`: what a shell and its manual know of the command.

use crate::arguments::{Arguments, Completions, Man};
use crate::{Failure, Verdict, output};
use clap::CommandFactory;

pub fn completions(one: &Completions) -> Result<Verdict, Failure> {
    let mut text = vec![];
    clap_complete::generate(one.shell, &mut Arguments::command(), "greybox", &mut text);
    output::print(&text)?;
    Ok(Verdict::Usable)
}

pub fn man(one: &Man) -> Result<Verdict, Failure> {
    let command = Arguments::command();
    match &one.folder {
        None => {
            let mut page = vec![];
            clap_mangen::Man::new(command).render(&mut page)?;
            output::print(&page)?;
        }
        Some(folder) => {
            std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
            clap_mangen::generate_to(command, folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        }
    }
    Ok(Verdict::Usable)
}
