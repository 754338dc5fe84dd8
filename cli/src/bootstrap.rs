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
    terminal.whole_only();
    let found = bootstrap(&examined.problem, &examined.estimate, resampling, one.refits, one.seed);
    bar.finish_and_clear();
    if found.is_err() && terminal.stopped() {
        return Err("ended by Ctrl-C: the refits so far are lost, because intervals need all that are asked for; run it again, \
                    with fewer --refits if it took too long"
            .into());
    }
    said(&one.refit, &examined, vec![Section::from(found?)], terminal)
}
