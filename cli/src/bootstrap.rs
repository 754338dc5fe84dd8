//! `bootstrap`: intervals by refits of resampled records.

use crate::arguments::Bootstrap;
use crate::describe::{examined, said};
use crate::terminal::Terminal;
use crate::{Failure, Verdict};
use greybox::diagnose::{Resampling, bootstrap};
use greybox::report::Section;

pub fn run(one: &Bootstrap, terminal: &Terminal) -> Result<Verdict, Failure> {
    let examined = examined(&one.refit, terminal)?;
    let resampling = one.blocks.map_or(Resampling::Residuals, Resampling::Blocks);
    let bar = terminal.counted(one.refits, "refits of resampled records", &examined.counter);
    let found = bootstrap(&examined.problem, &examined.estimate, resampling, one.refits, one.seed);
    bar.finish_and_clear();
    let found = found?;
    if found.tried < one.refits as u64 {
        terminal
            .remark(format_args!("ended after {} of {} refits: the intervals are of these", found.tried, one.refits));
    }
    said(&one.refit, &examined, vec![Section::from(found)], terminal)
}
