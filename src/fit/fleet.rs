//! [`Fleet`]: the same fit of many records, each by itself.

use super::fittable::{Made, finer, stepping};
use super::lockstep::fit_together;
#[cfg(feature = "parallel")]
use super::prefetch::in_order;
use super::{Fit, Records};
use crate::error::Error;
use crate::estimate::Summary;
use crate::parameter::Parameter;
use crate::problem::{FinerSweeps, Problem, Settings};
use crate::record::{Record, Time};
use crate::sweep::Sweep;
use core::marker::PhantomData;
use std::collections::VecDeque;
use std::iter::Fuse;
use std::sync::Arc;

/// Records whose fits are advanced together: more than there are lanes, so that few lanes are idle when some have
/// ended.
const GROUP: usize = 32;

/// One fit of many records, each by itself: motors on a test bench, drives in the field.
///
/// The model is compiled once. Records with the same hold and the same kind of time (uniform or not) run in parallel
/// vector lanes, groups of them on threads. Every answer is that of [`Fit::run`] of the record, up to rounding, finer steps
/// of a default integrator included; a record that fails does not affect the others. Records that are fitted together share
/// the sum of their time limits.
pub struct Fleet<'a, M> {
    fits: Fits<'a>,
    model: PhantomData<fn() -> M>,
}

/// A fleet whose quantities are known by position.
#[derive(Clone)]
struct Fits<'a> {
    /// Of evenly spaced samples, and of others.
    even: Sweeps<'a>,
    uneven: Sweeps<'a>,
    parameters: Vec<Parameter>,
    settings: Settings,
}

#[derive(Clone)]
struct Sweeps<'a> {
    first: Arc<dyn Sweep + 'a>,
    finer: Arc<FinerSweeps<'a>>,
}

impl<'a, M: Made> Fit<'a, M> {
    /// A fleet with this fit's model and settings. The records of the fit are not used.
    ///
    /// # Errors
    /// An integrator or a predictor that does not support the model; settings that only a single fit can have (a
    /// checkpoint, observers).
    pub fn fleet(self) -> Result<Fleet<'a, M>, Error> {
        let (model, predictor) = (self.model.lent(), self.predictor.as_ref());
        let chosen = self.stepping.as_ref();
        let stepping = |evenly: bool| stepping(&*model, chosen, predictor, evenly);
        let sweeps = |stepping: Option<M::Stepping>| -> Result<Sweeps<'a>, Error> {
            let first = M::sweep(model.clone(), stepping.as_ref(), predictor)?;
            Ok(Sweeps { first, finer: finer(model.clone(), stepping.as_ref(), predictor) })
        };
        let of_even = stepping(true);
        let is_crossed = chosen.is_none() && of_even.is_some();
        let even = sweeps(of_even)?;
        let uneven = if is_crossed { sweeps(stepping(false))? } else { even.clone() };
        let fits = Fits { even, uneven, parameters: self.parameters, settings: self.settings };
        Ok(Fleet { fits: fits.checked()?, model: PhantomData })
    }
}

impl<'a, M: Made> Fleet<'a, M> {
    /// Begins the declaration of a fleet; parameters and settings follow.
    ///
    /// ```
    /// # use greybox::*;
    /// # use greybox::pmsm::{Currents, Drive, Surface, Winding};
    /// # fn example(records: Vec<ExperimentOf<Surface>>) -> Result<(), Box<dyn std::error::Error>> {
    /// # let model = Surface::new(4)?;
    /// let parameters = Winding { rs: free(1.0), ls: free(1e-3), ke: free(0.5) };
    /// let fleet = Fleet::new(&model).parameters(parameters).fleet()?;
    /// for motor in fleet.run(records) {
    ///     match motor {
    ///         Ok(motor) => println!("{}", motor.parameters.rs),
    ///         Err(error) => eprintln!("{error}"),
    ///     }
    /// }
    /// # Ok(())
    /// # }
    /// ```
    #[expect(clippy::new_ret_no_self, reason = "a fleet without parameters is not a fleet yet")]
    pub fn new(model: &'a M) -> Records<'a, M> {
        Records { model, records: vec![] }
    }

    /// Fits the records and returns an iterator of the answers in their order. It is lazy: 128 records per thread are read
    /// ahead, or up to 512 while the fit of an early one takes long and the others go on.
    pub fn run<R>(&self, records: R) -> impl Iterator<Item = Result<M::Estimate, Error>>
    where
        R: IntoIterator<Item = M::Record>,
    {
        let records = records.into_iter().map(|record| M::record(&record).clone());
        self.fits.clone().answers(records).map(|answer| M::estimate(answer?))
    }

    /// Fits one record.
    ///
    /// # Errors
    /// As [`Fit::run`].
    pub fn fit(&self, record: &M::Record) -> Result<M::Estimate, Error> {
        M::estimate(self.fits.problem(M::record(record).clone())?.run()?)
    }
}

impl<'a> Fits<'a> {
    /// Refuses settings that only a single fit can have. Each record is fitted by itself, so that all its values are its own anyway.
    fn checked(mut self) -> Result<Self, Error> {
        if self.settings.checkpoint.is_some() || !self.settings.observers.is_empty() {
            let text = "a fleet writes no checkpoint and shows no progress; ask its answers, which come in order";
            return Err(Error::Option(text.to_owned()));
        }
        self.settings.optimizer.check()?;
        let free = self.parameters.iter_mut().filter(|parameter| parameter.free);
        free.for_each(|parameter| parameter.per_experiment = false);
        Ok(self)
    }

    fn answers<R: IntoIterator<Item = Record>>(self, records: R) -> Answers<'a, R::IntoIter> {
        Answers { fits: self, records: records.into_iter().fuse(), ready: VecDeque::new() }
    }

    fn problem(&self, record: Record) -> Result<Problem<'a>, Error> {
        let Sweeps { first, finer } = if is_even(&record) { &self.even } else { &self.uneven };
        let problem = Problem::new(first.clone(), vec![record], &self.parameters, self.settings.clone())?;
        Ok(problem.refining(finer.clone()))
    }

    fn group(&self, records: &[Record]) -> Vec<Result<Summary, Error>> {
        let (mut even, mut uneven) = (vec![], vec![]);
        // Of what is wrong the error, of what is fitted whether its samples are evenly spaced.
        let sorted = |record: &Record| {
            let (problem, is_even) = (self.problem(record.clone())?, is_even(record));
            if is_even {
                even.push(problem)
            } else {
                uneven.push(problem)
            }
            Ok(is_even)
        };
        let sorted: Vec<Result<bool, Error>> = records.iter().map(sorted).collect();
        let [mut even, mut uneven] = [even, uneven].map(|problems| self.fitted(&problems).into_iter());
        let answer = |sorted: Result<bool, Error>| match sorted {
            Ok(true) => even.next(),
            Ok(false) => uneven.next(),
            Err(error) => Some(Err(error)),
        };
        sorted.into_iter().filter_map(answer).collect()
    }

    /// The answers of problems with one sweep: together, where such records run in more than one lane.
    fn fitted(&self, problems: &[Problem<'_>]) -> Vec<Result<Summary, Error>> {
        let Some(first) = problems.first() else { return vec![] };
        let single = self.settings.prefilter.is_none() && self.settings.searches.count() == 1;
        match single && first.sweep.lanes(&first.records[0], first.unknowns.seeds(0)) > 1 {
            true => fit_together(problems),
            false => problems.iter().map(Problem::run).collect(),
        }
    }
}

fn is_even(record: &Record) -> bool {
    matches!(record.times(), Time::Uniform { .. })
}

/// Iterator of the answers of a fleet, in the order of its records.
struct Answers<'a, R> {
    fits: Fits<'a>,
    records: Fuse<R>,
    ready: VecDeque<Result<Summary, Error>>,
}

impl<R: Iterator<Item = Record>> Iterator for Answers<'_, R> {
    type Item = Result<Summary, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ready.is_empty() {
            let records = self.records.by_ref();
            let group = || -> Option<Vec<Record>> {
                Some(records.take(GROUP).collect()).filter(|records: &Vec<_>| !records.is_empty())
            };
            let fits = &self.fits;
            self.ready.extend(in_order(group, |group| fits.group(&group)).into_iter().flatten());
        }
        self.ready.pop_front()
    }
}

/// The results of the next group.
#[cfg(not(feature = "parallel"))]
fn in_order<T, A>(mut next: impl FnMut() -> Option<T>, f: impl Fn(T) -> A) -> Option<A> {
    next().map(f)
}
