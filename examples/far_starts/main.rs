//! Fits from far starts: how many of them end right, what the others say, and what they cost.
//!
//! `far_starts CASE [--count=100] [--seed=1] [--emps=emps.csv]`, with a case of
//!
//! - `lorenz`, `lorenz-long`: a chaotic plant, all states measured for 20 or 80 time units, parameters three times off;
//! - `lorenz-x`: the same where only `x` is measured;
//! - `replica`: an axis in an open loop from a start that is unstable, each time with another record;
//! - `emps-open`, `emps-closed`: the recorded axis (`--emps`) from starts drawn over two decades.
//!
//! `--starts=N` asks for so many starts of each fit, `--plain` for one search alone, `--staged` for stages and `--multiple-shooting` for multiple
//! shooting before it.

mod axis;
mod lorenz;
#[path = "../common/terminal.rs"]
mod terminal;

use clap::{Parser, ValueEnum};
use cpu_time::ProcessTime;
use greybox::{Error, Fit, Model, Severity, Summary};
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::{path::PathBuf, process::ExitCode};

#[derive(Clone, Copy, ValueEnum)]
enum Case {
    Lorenz,
    LorenzLong,
    LorenzX,
    Replica,
    EmpsOpen,
    EmpsClosed,
}

/// Fits from far starts: how many of them end right, what the others say, and what they cost.
#[derive(Parser)]
struct Arguments {
    case: Case,
    /// Fits.
    #[arg(long, default_value_t = 100)]
    count: u64,
    /// Of the random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The record of the EMPS benchmark.
    #[arg(long)]
    emps: Option<PathBuf>,
    /// How many starts each fit has.
    #[arg(long, conflicts_with_all = ["plain", "staged", "multiple_shooting"])]
    starts: Option<usize>,
    /// One search from the declared start, and no other.
    #[arg(long)]
    plain: bool,
    /// In stages from the first search on.
    #[arg(long, conflicts_with = "plain")]
    staged: bool,
    /// By multiple shooting alone before the first search.
    #[arg(long, conflicts_with_all = ["plain", "staged"])]
    multiple_shooting: bool,
    /// Prints the estimate of each fit.
    #[arg(long)]
    verbose: bool,
}

/// Random numbers of a fit.
struct Random(Xoshiro256PlusPlus);

impl Random {
    fn uniform(&mut self, from: f64, to: f64) -> f64 {
        let unit: f64 = StandardUniform.sample(&mut self.0);
        from + (to - from) * unit
    }

    fn log_uniform(&mut self, from: f64, to: f64) -> f64 {
        self.uniform(from.ln(), to.ln()).exp()
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// How the fits of a study are made.
struct Study<'a>(&'a Arguments);

/// One fit of a study.
struct Ended {
    /// The distance from the right answer, one or less where it is right.
    distance: f64,
    severity: Severity,
}

impl Study<'_> {
    fn of<'f, M: Model>(&self, fit: Fit<'f, M>) -> Fit<'f, M> {
        match (self.0.starts, self.0.plain) {
            (Some(count), _) => fit.starts(count),
            (None, true) => fit.starts(1),
            _ if self.0.staged => fit.staged(),
            _ if self.0.multiple_shooting => fit.multiple_shooting(),
            _ => fit,
        }
    }

    fn ended(&self, found: Result<&Summary, &Error>, distance: impl Fn(&Summary) -> f64) -> Ended {
        if self.0.verbose {
            match &found {
                Ok(found) => println!("{found}\n"),
                Err(error) => println!("{error}\n"),
            }
        }
        match found {
            Ok(found) => Ended { distance: distance(found), severity: found.severity() },
            Err(_) => Ended { distance: f64::INFINITY, severity: Severity::NotUsable },
        }
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Error> {
    let study = Study(arguments);
    let emps = || arguments.emps.clone().ok_or_else(|| Error::Option("name the record: --emps=emps.csv".to_owned()));
    let one: Box<dyn Fn(Random) -> Result<Ended, Error>> = match arguments.case {
        Case::Lorenz => Box::new(|random| lorenz::all(&study, random, 20.0)),
        Case::LorenzLong => Box::new(|random| lorenz::all(&study, random, 80.0)),
        Case::LorenzX => Box::new(|random| lorenz::first_alone(&study, random)),
        Case::Replica => Box::new(|random| axis::replica(&study, random)),
        Case::EmpsOpen => {
            let record = axis::open_record(&emps()?)?;
            let study = &study;
            Box::new(move |random| axis::open(study, &record, random))
        }
        Case::EmpsClosed => {
            let record = axis::closed_record(&emps()?)?;
            let study = &study;
            Box::new(move |random| axis::closed(study, &record, random))
        }
    };
    let bar = terminal::steps(arguments.count as usize, "fits");
    let begin = ProcessTime::now();
    let mut ended = vec![];
    for k in 0..arguments.count {
        let random = Random(Xoshiro256PlusPlus::seed_from_u64(arguments.seed * 1_000_000 + k));
        ended.push(one(random)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let count = |test: &dyn Fn(&Ended) -> bool| ended.iter().filter(|one| test(one)).count();
    let is_right = |one: &Ended| one.distance <= 1.0;
    let of = |right: bool, severity: Severity| count(&|one| is_right(one) == right && one.severity == severity);
    println!("{:<8}{:>8}{:>12}{:>12}{:>8}", "", "usable", "with care", "not usable", "all");
    for (name, right) in [("right", true), ("wrong", false)] {
        let [usable, care, not] =
            [Severity::Usable, Severity::UsableWithCare, Severity::NotUsable].map(|s| of(right, s));
        println!("{name:<8}{usable:>8}{care:>12}{not:>12}{:>8}", usable + care + not);
    }
    println!("processor time of a fit: {:.2} s", begin.elapsed().as_secs_f64() / arguments.count as f64);
    let wrong: Vec<String> =
        ended.iter().enumerate().filter(|(_, one)| !is_right(one)).map(|(k, _)| k.to_string()).collect();
    if !wrong.is_empty() {
        println!("wrong: {}", wrong.join(" "));
    }
    Ok(())
}
