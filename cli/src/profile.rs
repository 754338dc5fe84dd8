//! `profile`: likelihood profiles.

use crate::arguments::Profile;
use crate::describe::{examined, said};
use crate::terminal::Terminal;
use crate::{Failure, Verdict};
use greybox::diagnose::profile;
use greybox::report::Section;

pub fn run(one: &Profile, terminal: &Terminal) -> Result<Verdict, Failure> {
    let examined = examined(&one.refit, terminal)?;
    let names = match one.names.is_empty() {
        true => examined.problem.unknowns(),
        false => one.names.clone(),
    };
    let bar = terminal.steps(names.len(), "profiles");
    let mut sections = vec![];
    for name in &names {
        if terminal.stopped() {
            terminal.remark("ended by Ctrl-C: further profiles are left out");
            break;
        }
        match profile(&examined.problem, &examined.estimate, name, one.probability) {
            Ok(found) => sections.push(Section::from(found)),
            Err(_) if terminal.stopped() => {}
            Err(error) => return Err(error.into()),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    said(&one.refit, &examined, sections, terminal)
}
