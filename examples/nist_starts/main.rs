//! Problems of NIST's Statistical Reference Datasets from bad starts: how many searches end right, which of the others say so,
//! and what they cost. The starts, and what SciPy makes of them, come from `starts.py` beside this file:
//!
//! `nist_starts FOLDER_OF_DAT FOLDER_OF_STARTS [PROBLEM...]`
//!
//! With `--starts=20` in front, each fit searches from 20 starts, of which the one in the file is the declared one
//! (`Fit::starts`).

#[path = "../nist/file.rs"]
#[allow(dead_code, reason = "this example reads the files and fits them its own way")]
mod file;
#[path = "../nist/problems.rs"]
mod problems;
#[path = "../common/terminal.rs"]
mod terminal;

use file::File;
use greybox::optimize::{Domain, LeastSquares, LevenbergMarquardt, Machine, Request};
use greybox::{Error, Fit, Model, Nothing, Signals, WarningCode, free, problem::Objective};
use problems::{Predictors, Response, Task};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Searches from many starts.
struct Starts<'a> {
    file: &'a File,
    starts: &'a [Vec<f64>],
    /// Searches of each fit.
    searches: usize,
}

/// Sum of squares, whether nothing is said against it, evaluations.
struct Ended {
    squares: f64,
    silent: bool,
    evaluations: u64,
}

/// A second derivative counts as one evaluation more.
fn search(objective: &Objective<'_>, start: &[f64]) -> Ended {
    let mut search: LevenbergMarquardt = LevenbergMarquardt::default();
    let mut evaluations = 0;
    search.begin(start.to_vec(), Domain::of(objective));
    loop {
        evaluations += 1;
        match search.request() {
            Request::Linearize(x) => search.tell(objective.linearize(x)),
            Request::Curvature { x, along } => search.tell_curvature(objective.curvature(x, along)),
            Request::Ended(outcome) => {
                let squares = search.linearization().map_or(f64::INFINITY, |linear| 2.0 * linear.cost);
                return Ended { squares, silent: outcome.converged(), evaluations: evaluations - 1 };
            }
        }
    }
}

impl Task for Starts<'_> {
    /// The certified sum of squares, and the searches.
    type Answer = Result<(f64, Vec<Ended>), Error>;

    fn run<M: Model<State = Nothing, Input = Predictors, Output = Response> + Clone>(self, model: &M) -> Self::Answer {
        let record = self.file.record(model)?;
        let parameter = |i: usize| self.file.parameters.get(i).map_or(f64::NAN, |parameter| parameter[2]);
        let problem = Fit::new(model, &record).parameters(M::Parameters::from_fn(|i| free(parameter(i)))).problem()?;
        let objective = problem.objective()?;
        let certified =
            2.0 * objective.linearize(&objective.start()).map_err(|e| Error::Optimizer(e.to_string()))?.cost;
        let many = |start: &Vec<f64>| {
            let value = |i: usize| start.get(i).copied().unwrap_or(f64::NAN);
            let parameters = M::Parameters::from_fn(|i| free(value(i)));
            let found = Fit::new(model, &record).parameters(parameters).starts(self.searches).run();
            found.map_or(Ended { squares: f64::INFINITY, silent: false, evaluations: 0 }, |found| {
                let codes = [WarningCode::MinimumFoundOnce, WarningCode::RivalMinimum];
                let doubted = found.warnings.iter().any(|warning| codes.contains(&warning.code));
                let evaluations = found.starts.as_ref().map_or(0, |starts| starts.evaluations);
                Ended { squares: 2.0 * found.cost, silent: found.outcome.converged() && !doubted, evaluations }
            })
        };
        let ended = match self.searches {
            1 => self.starts.iter().map(|start| search(&objective, start)).collect(),
            _ => self.starts.iter().map(many).collect(),
        };
        Ok((certified, ended))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let searches = arguments.first().and_then(|first| first.strip_prefix("--starts=")).map(str::parse).transpose()?;
    let arguments = &arguments[usize::from(searches.is_some())..];
    let [folder, starts, wanted @ ..] = arguments else {
        return Err("usage: nist_starts [--starts=N] FOLDER_OF_DAT FOLDER_OF_STARTS [PROBLEM...]".into());
    };
    println!("silent: wrong, and it was not said; median: evaluations of the right ones");
    println!("starts             of  right  silent  median  evaluations  ms/search");
    let mut paths: Vec<_> =
        std::fs::read_dir(starts)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    paths.sort();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "txt"));
    let (stop, bar) = (terminal::interrupted()?, terminal::steps(paths.len(), "problems"));
    for path in paths.iter().take_while(|_| !stop.load(Ordering::Relaxed)) {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let name = stem.split('_').next().unwrap_or_default();
        if !wanted.is_empty() && !wanted.iter().any(|wanted| wanted == name) {
            bar.inc(1);
            continue;
        }
        let numbers = |line: &str| line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>();
        let starts = std::fs::read_to_string(path)?.lines().map(numbers).collect::<Result<Vec<_>, _>>()?;
        let file = File::read(&Path::new(folder).join(format!("{name}.dat")))?;
        let begin = Instant::now();
        let task = Starts { file: &file, starts: &starts, searches: searches.unwrap_or(1) };
        let (certified, all) = problems::by_name(name, task).ok_or("not a known problem")??;
        let time = begin.elapsed().as_secs_f64() * 1e3 / all.len() as f64;
        let is_right = |ended: &&Ended| ended.squares <= certified * (1.0 + 1e-4) + 1e-22;
        let mut right: Vec<u64> = all.iter().filter(is_right).map(|ended| ended.evaluations).collect();
        right.sort_unstable();
        let silent = all.iter().filter(|ended| !is_right(ended) && ended.silent).count();
        let median = right.get(right.len() / 2).copied().unwrap_or(0);
        let sum: u64 = all.iter().map(|ended| ended.evaluations).sum();
        let count = all.len();
        let row = format!("{stem:15} {count:5} {:6} {silent:7} {median:7} {sum:12} {time:10.2}", right.len());
        bar.suspend(|| println!("{row}"));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}
