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
use crate::record::Record;
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
    sweep: Arc<dyn Sweep + 'a>,
    finer: Arc<FinerSweeps<'a>>,
    parameters: Vec<Parameter>,
    settings: Settings,
}

impl<'a, M: Made> Fit<'a, M> {
    /// A fleet with this fit's model and settings. The records of the fit are not used.
    ///
    /// # Errors
    /// An integrator or a predictor that does not support the model; settings that only a single fit can have (a
    /// checkpoint, observers).
    pub fn fleet(self) -> Result<Fleet<'a, M>, Error> {
        let (model, predictor) = (self.model.lent(), self.predictor.as_ref());
        let stepping = stepping(&*model, self.stepping.as_ref(), predictor);
        let sweep = M::sweep(model.clone(), stepping.as_ref(), predictor)?;
        let finer = finer(model, stepping.as_ref(), predictor);
        let fits = Fits { sweep, finer, parameters: self.parameters, settings: self.settings };
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
        let problem = Problem::new(self.sweep.clone(), vec![record], &self.parameters, self.settings.clone())?;
        Ok(problem.refining(self.finer.clone()))
    }

    fn group(&self, records: &[Record]) -> Vec<Result<Summary, Error>> {
        let problems: Vec<_> = records.iter().map(|record| self.problem(record.clone())).collect();
        let mut answers: Vec<Option<Result<Summary, Error>>> = Vec::with_capacity(problems.len());
        let mut valid = vec![];
        for problem in problems {
            match problem {
                Ok(problem) => {
                    valid.push(problem);
                    answers.push(None);
                }
                Err(error) => answers.push(Some(Err(error))),
            }
        }
        let single = self.settings.prefilter.is_none() && self.settings.searches.count() == 1;
        let mut found = match single && self.is_wide(&valid) {
            true => fit_together(&valid),
            false => valid.iter().map(Problem::run).collect(),
        }
        .into_iter();
        answers.into_iter().filter_map(|answer| answer.or_else(|| found.next())).collect()
    }

    /// Whether such records run in more than one lane.
    fn is_wide(&self, problems: &[Problem<'_>]) -> bool {
        problems.first().is_some_and(|problem| self.sweep.lanes(&problem.records[0], problem.unknowns.seeds(0)) > 1)
    }
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
