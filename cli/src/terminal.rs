//! Progress and remarks on standard error, color, and Ctrl-C.

use crate::remedies::in_shell;
use argmin::core::observers::Observe;
use argmin::core::{KV, State};
use greybox::optimize::LeastSquaresState;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A line on standard error. A reader that has seen enough is no error.
pub fn note(text: impl std::fmt::Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// What stands between the command and whoever runs it.
pub struct Terminal {
    quiet: bool,
    /// Raised by the first Ctrl-C.
    stop: Arc<AtomicBool>,
}

impl Terminal {
    pub fn new(quiet: bool) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let raised = stop.clone();
        // Where a handler cannot be set, Ctrl-C ends the program as it always does.
        let _ = ctrlc::set_handler(move || {
            if raised.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
            note("\nending with the best so far; once more to end at once");
        });
        Terminal { quiet, stop }
    }

    /// The same without remarks and progress.
    pub fn silent(&self) -> Self {
        Terminal { quiet: true, stop: self.stop.clone() }
    }

    /// Whether standard output is to be in color: a terminal, unless NO_COLOR is set (no-color.org).
    pub fn colored(&self) -> bool {
        std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
    }

    /// A remark, in one line, in the words of the command line.
    pub fn remark(&self, text: impl std::fmt::Display) {
        if !self.quiet {
            note(in_shell(&text.to_string()));
        }
    }

    /// The flag that ends a search.
    pub fn stop(&self) -> Arc<AtomicBool> {
        self.stop.clone()
    }

    /// Whether Ctrl-C was pressed.
    pub fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// A line of progress; nothing where there is nobody to see it.
    fn bar(&self, bar: ProgressBar) -> ProgressBar {
        if self.quiet || !std::io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        bar.enable_steady_tick(Duration::from_millis(100));
        bar
    }

    /// Work of a known number of steps, with the time left.
    pub fn steps(&self, count: usize, what: &str) -> ProgressBar {
        let bar = self.bar(ProgressBar::new(count as u64).with_message(what.to_owned()));
        match ProgressStyle::with_template("{msg} {bar:30} {pos}/{len}, {eta} left") {
            Ok(style) => bar.with_style(style),
            Err(_) => bar,
        }
    }

    /// The same of steps that the library counts.
    pub fn counted(&self, count: usize, what: &str, counter: &Arc<AtomicU64>) -> ProgressBar {
        let (bar, counter) = (self.steps(count, what), counter.clone());
        let shown = bar.clone();
        if !shown.is_hidden() {
            std::thread::spawn(move || {
                while !shown.is_finished() {
                    shown.set_position(counter.load(Ordering::Relaxed));
                    std::thread::sleep(Duration::from_millis(100));
                }
            });
        }
        bar
    }

    /// A search, with its cost and, if it has a time limit, the time left.
    pub fn search(&self, limit: Option<Duration>) -> Search {
        let bar = self.bar(ProgressBar::new_spinner().with_message("reading the model"));
        Search { bar, begin: Instant::now(), limit }
    }
}

/// Shows a search as a moving line.
pub struct Search {
    bar: ProgressBar,
    begin: Instant,
    limit: Option<Duration>,
}

impl Observe<LeastSquaresState> for Search {
    fn observe_iter(&mut self, state: &LeastSquaresState, kv: &KV) -> Result<(), argmin::core::Error> {
        let running = kv.get("running").map_or(String::new(), |count| format!("{count} searches running, "));
        let left = self.limit.map(|limit| limit.saturating_sub(self.begin.elapsed()).as_secs());
        let left = left.map_or(String::new(), |left| format!(", at most {left} s left"));
        let (iteration, cost) = (state.get_iter(), state.get_cost());
        self.bar.set_message(format!("{running}iteration {iteration}, cost {cost:.6e}{left}"));
        Ok(())
    }
}

impl Drop for Search {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
