//! What a program in a terminal needs: color where it is wanted, progress where there is someone to see it, and a Ctrl-C
//! that ends a search with the best so far.
#![allow(dead_code, reason = "each example uses some of it")]

use argmin::core::observers::Observe;
use argmin::core::{KV, State};
use greybox::optimize::LeastSquaresState;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Whether to print in color: to a terminal, unless NO_COLOR is set (no-color.org).
pub fn colored() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// A flag that the first Ctrl-C raises, for `Fit::cancel`; the second ends the program.
pub fn interrupted() -> Result<Arc<AtomicBool>, ctrlc::Error> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = flag.clone();
    ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        eprintln!("\nending with the best so far; once more to end at once");
    })?;
    Ok(flag)
}

/// A line on standard error that shows work of unknown length; nothing, if that is no terminal.
pub fn spinner(what: &str) -> ProgressBar {
    let bar = ProgressBar::new_spinner().with_message(what.to_owned());
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

/// The same of so many steps.
pub fn steps(count: usize, what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {bar:30} {pos}/{len} {eta}");
    let bar = ProgressBar::new(count as u64).with_message(what.to_owned());
    bar.enable_steady_tick(Duration::from_millis(100));
    match style {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// The same of steps that the library counts (`Fit::counter`).
pub fn counted(count: usize, what: &str, counter: &Arc<AtomicU64>) -> ProgressBar {
    counter.store(0, Ordering::Relaxed);
    let (bar, counter) = (steps(count, what), counter.clone());
    let shown = bar.clone();
    std::thread::spawn(move || {
        while !shown.is_finished() {
            shown.set_position(counter.load(Ordering::Relaxed));
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    bar
}

/// Shows a search as a moving line.
pub struct Search(pub ProgressBar);

impl Observe<LeastSquaresState> for Search {
    fn observe_iter(&mut self, state: &LeastSquaresState, kv: &KV) -> Result<(), argmin::core::Error> {
        let running = kv.get("running").map_or(String::new(), |count| format!("{count} searches running, "));
        self.0.set_message(format!("{running}iteration {}, cost {:.6e}", state.get_iter(), state.get_cost()));
        Ok(())
    }

    fn observe_final(&mut self, _: &LeastSquaresState) -> Result<(), argmin::core::Error> {
        self.0.finish_and_clear();
        Ok(())
    }
}
